"""Legs of a real Go2: how much of the held-out error does the diagnosis close?"""

import csv
import gzip
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bench.gap import real_data
from bench.result import Result, bench
from bns.errors import BnsError

JOINT_FIT = {"FL": 0.91, "RR": 0.81}
"""share that thirteen numbers fitted together close (least squares on all of them)"""
SHARE, TIME = 0.95, 60.0
FITTED = 0.7  # of the time
WINDOW = 0.02  # [s] between two samples that are compared
EXPECTED = ("joint_friction[calf]", "joint_damping", "joint_armature[calf]")
JOINTS = ("hip", "thigh", "calf")
KP, KD, TORQUE = 20.0, 1.5, (23.7, 23.7, 45.43)  # the robot's own loop
DAMPING, FRICTION, ARMATURE = 0.6, 0.2, 0.01  # published nominal joints

# published bodies: position, mass, centre of mass, inertia, axes; of the front left leg
_QUAT = {
    "FL": (
        "0.497014 0.499245 0.505462 0.498237",
        "0.829533 0.0847635 -0.0200632 0.551623",
        "0.710672 0.00154099 -0.00450087 0.703508",
    ),
    "RR": (
        "0.499245 0.497014 0.498237 0.505462",
        "0.551623 -0.0200632 0.0847635 0.829533",
        "0.703508 -0.00450087 0.00154099 0.710672",
    ),
}
_RANGE = {"F": "-1.5708 3.4907", "R": "-0.5236 4.5379"}


@bench(
    "legs of a real Go2, fitted on the first 70 %: share of held-out error closed",
    bar=">= 0.95 of the joint fit's 0.91 (FL) and 0.81 (RR), <= 60 s",
)
def gap_go2(quick: bool) -> Result:
    """Both legs; quick takes the front one."""
    legs = ("FL",) if quick else ("FL", "RR")
    rows = {leg: leg_row(leg) for leg in legs}
    ratio = min(row["closed"] / JOINT_FIT[leg] for leg, row in rows.items())
    slowest = max(row["seconds"] for row in rows.values())
    named = all(row["expected_named"] for row in rows.values())
    return Result(
        figure=round(ratio, 3),
        unit="of the joint fit's share",
        holds=ratio >= SHARE and slowest <= TIME and named,
        n=len(rows),
        details=rows,
    )


def leg_row(leg: str) -> dict[str, object]:
    """Diagnose the first part of a leg's recording, predict the rest."""
    from bns.gap.diagnose import diagnose
    from bns.gap.models.mjcf.model import OwnModel
    from bns.gap.recordings import load_recordings

    with tempfile.TemporaryDirectory() as scratch:
        home = Path(scratch)
        samples = _samples(leg)
        write_model(leg, home)
        _write_log(samples, home / "all.csv")
        last = samples["time"][0] + FITTED * np.ptp(samples["time"])
        inside = samples["time"] <= last
        _write_log({k: v[inside] for k, v in samples.items()}, home / "first.csv")
        model = OwnModel.read(home / "leg.toml", threads=2)
        trials = load_recordings.trials([str(home / "first.csv")], model)
        begin = time.perf_counter()
        found = diagnose(trials, model, full=False)
        seconds = time.perf_counter() - begin
        (whole,) = load_recordings.trials([str(home / "all.csv")], model)
        fit = found.fits[0]
        effects = [OwnModel.parse(text) for text in fit.effects]
        paths = [path[0] for path in model.simulate([whole], [(), effects])]
    late = whole.times > last - samples["time"][0]
    errors = [((path - whole.observed)[late] ** 2).mean() for path in paths]
    names = [part["name"] for part in found.decomposition["parts"]]
    return {
        "closed": 1 - errors[1] / errors[0],
        "rms_nominal_rad": float(np.sqrt(errors[0])),
        "rms_corrected_rad": float(np.sqrt(errors[1])),
        "seconds": seconds,
        "verdict": found.verdict.kind,
        "effects": list(fit.effects),
        "last_in": {p["name"]: p["last"] for p in found.decomposition["parts"]},
        "expected_named": all(
            any(name.startswith(wanted) for name in names) for wanted in EXPECTED
        ),
        "left": found.decomposition["left"],
    }


def _samples(leg: str) -> dict[str, np.ndarray]:
    path = real_data.needed("go2_legs") / f"{leg}.csv.gz"
    with gzip.open(path, "rt") as lines:
        head, *rows = csv.reader(lines)
    values = np.array(rows, dtype=float)
    names = ("time", *(f"{j}_goal" for j in JOINTS), *JOINTS)
    if len(head) != len(names):
        raise BnsError(f"{path} has {len(head)} columns, not {len(names)}.")
    return dict(zip(names, values.T, strict=True))


def _write_log(samples: Mapping[str, np.ndarray], path: Path) -> None:
    with path.open("w", newline="") as lines:
        out = csv.writer(lines)
        out.writerow(samples)
        out.writerows(np.stack(list(samples.values()), axis=1).round(7))


def write_model(leg: str, home: Path) -> None:
    """The published leg as `leg.xml`, and its description as `leg.toml`."""
    (home / "leg.xml").write_text(mjcf(leg), encoding="utf-8")
    (home / "leg.toml").write_text(description(), encoding="utf-8")


def mjcf(leg: str) -> str:
    """The published model of a leg, held in the air."""
    front, left = leg[0] == "F", leg[1] == "L"
    x, y = (1 if front else -1), (1 if left else -1)
    hip, thigh, calf = _QUAT[leg]

    def joint(name: str, axis: str, span: str) -> str:
        return (
            f'<joint name="{name}" axis="{axis}" range="{span}" damping="{DAMPING}" '
            f'frictionloss="{FRICTION}" armature="{ARMATURE}"/>'
        )

    motors = "".join(
        f'<general name="{name}" joint="{name}" gainprm="{KP}" biastype="affine" '
        f'biasprm="0 {-KP} {-KD}" forcerange="{-most} {most}"/>'
        for name, most in zip(JOINTS, TORQUE, strict=True)
    )
    return f"""<mujoco>
<option timestep="0.0025" integrator="implicitfast"/>
<compiler angle="radian" autolimits="true"/>
<worldbody>
<body name="hip" pos="{0.1934 * x} {0.0465 * y} 0">
<inertial pos="{-0.0054 * x} {0.00194 * y} -0.000105" mass="0.678"
 diaginertia="8.8403e-4 5.96003e-4 4.79967e-4" quat="{hip}"/>
{joint("hip", "1 0 0", "-1.0472 1.0472")}
<body name="thigh" pos="0 {0.0955 * y} 0">
<inertial pos="-0.00374 {-0.0223 * y} -0.0327" mass="1.152"
 diaginertia="5.94973e-3 5.84149e-3 8.78787e-4" quat="{thigh}"/>
{joint("thigh", "0 1 0", _RANGE[leg[0]])}
<body name="calf" pos="0 0 -0.213">
<inertial pos="0.00629595 {-0.000622121 * y} -0.141417" mass="0.241352"
 diaginertia="1.4901e-3 1.46356e-3 5.31397e-5" quat="{calf}"/>
{joint("calf", "0 1 0", "-2.7227 -0.83776")}
</body></body></body>
</worldbody>
<actuator>{motors}</actuator>
</mujoco>
"""


def description() -> str:
    """The TOML file that maps the log to the model."""
    words = ['name = "go2 leg"', 'model = "leg.xml"', f"window = {WINDOW}"]
    for name in JOINTS:
        words.append(
            f'[commands.{name}_goal]\nactuator = "{name}"\nunit = "rad"\n'
            "low = -3\nhigh = 5"
        )
    for name in JOINTS:
        words.append(f'[observed.{name}]\njoint = "{name}"\nunit = "rad"\nnoise = 7e-4')
    joints = str(list(JOINTS)).replace("'", '"')
    goals = str([f"{name}_goal" for name in JOINTS]).replace("'", '"')
    words.append("[start]\nrecorded = true")
    words.append("[effects]")
    for effect in ("damping", "friction", "armature"):
        words.append(f"joint_{effect} = {joints}")
    words.append(f"encoder_offset = {joints}\ncommand_offset = {goals}")
    words.append(f"actuator_kp = {joints}\nactuator_kd = {joints}")
    words.append('body_mass = ["thigh", "calf"]\ncommand_delay = "all"')
    bounds = [f'"joint_friction[{n}]" = {{high = 3}}' for n in JOINTS]
    bounds += [f'"joint_armature[{n}]" = {{high = 0.1}}' for n in JOINTS]
    bounds += [f'"command_offset[{n}_goal]" = {{low = -0.1, high = 0.1}}'
               for n in JOINTS]  # fmt: skip
    bounds += [f'"encoder_offset[{n}]" = {{low = -0.1, high = 0.1}}' for n in JOINTS]
    return "\n".join([*words, "[bounds]", *bounds]) + "\n"
