"""From an MJCF and a log to a verdict, without a file edited: four robots.

Their logs are as people have them, made with bare MuJoCo at half their step: a
reaching arm with motors that have no names, a crane with a position servo (the log
calls its parts otherwise), a leg in the air with a PD loop that its MJCF lacks (one
long curve), and the example quadruped (degrees, milliseconds). One thing is changed.
"""

import contextlib
import io
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import mujoco
import numpy as np

from bench.result import Result, bench
from bench.versions import ROOT

QUAD = ROOT / "examples" / "quad"
ARM = """<mujoco model="reacher"><compiler angle="radian"/>
  <option timestep="0.01" integrator="implicitfast" gravity="0 0 0"/>
  <default><joint armature="1" damping="1"/></default>
  <worldbody><body name="upper"><joint name="joint0" axis="0 0 1"/>
    <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01"/>
    <body name="fore" pos="0.1 0 0"><joint name="joint1" axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01"/></body></body>
    <body name="target" pos="0.1 -0.1 0"><joint name="target_x" type="slide"/>
      <geom type="sphere" size="0.01"/></body></worldbody>
  <actuator><motor gear="200" joint="joint0"/><motor gear="200" joint="joint1"/>
  </actuator></mujoco>"""
CRANE = """<mujoco model="crane">
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody><body name="trolley" pos="0 0 1.2">
    <joint name="rail" type="slide" axis="1 0 0" damping="4" frictionloss="0.5"/>
    <geom type="box" size="0.06 0.05 0.03" mass="1.5" contype="0" conaffinity="0"/>
    <body name="load"><joint name="swing" axis="0 1 0" damping="0.02"/>
      <geom type="sphere" pos="0 0 -0.6" size="0.05" mass="0.8" contype="0"
        conaffinity="0"/><site name="bob" pos="0 0 -0.6"/></body></body></worldbody>
  <actuator><position name="drive" joint="rail" kp="300" kv="40"/></actuator>
</mujoco>"""
LEG = """<mujoco model="leg"><compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <default><joint damping="0.6" frictionloss="0.2" armature="0.01"/></default>
  <worldbody><body name="FL_hip" pos="0 0 0.5">
    <joint name="FL_hip_joint" axis="1 0 0"/>
    <geom type="sphere" size="0.04" mass="0.7"/>
    <body name="FL_thigh" pos="0 0.09 0"><joint name="FL_thigh_joint" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.21" size="0.02" mass="1.1"/>
      <body name="FL_calf" pos="0 0 -0.21"><joint name="FL_calf_joint" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.21" size="0.01" mass="0.24"/>
      </body></body></body></worldbody>
  <actuator><motor joint="FL_hip_joint"/><motor joint="FL_thigh_joint"/>
    <motor joint="FL_calf_joint"/></actuator></mujoco>"""
KP, KD = 20.0, 1.5


@dataclass(frozen=True)
class Logged:
    """A robot's log.

    Attributes:
        model, log: its MJCF and its log.
        words: options of `bns gap describe`.
        parts: of each column that is observed: quantity and part.
    """

    model: Path
    log: Path
    words: tuple[str, ...]
    parts: dict[str, tuple[str, str]]


def steps(rng, channels: int, size: float, seconds: float) -> Callable:
    """Commands in steps of 0.5 s to 1.2 s, zero for the first 0.3 s."""
    ends = 0.3 + np.cumsum(rng.uniform(0.5, 1.2, int(2 * seconds)))
    values = np.round(rng.uniform(-size, size, (len(ends) + 1, channels)), 4)
    values[0] = 0.0
    return lambda time: values[np.searchsorted(np.append(0.3, ends), time, "right")]


def ran(model, told, read, seconds, rate, *, pose=-1) -> tuple[np.ndarray, ...]:
    """Times, commands and readings of one trial."""
    data = mujoco.MjData(model)
    if pose >= 0:
        mujoco.mj_resetDataKeyframe(model, data, pose)
    times, rows, goals = np.arange(0, seconds, 1 / rate), [], []
    for time in times:
        while data.time < time - 1e-9:
            data.ctrl[:] = told(data.time)
            mujoco.mj_step(model, data)
        goals.append(told(time))
        mujoco.mj_forward(model, data)
        rows.append(read(data))
    return times, np.array(goals), np.array(rows)


def written(path: Path, names: str, trials, noise, rng, factor=1.0, tick=1.0) -> None:
    """Write trials as a CSV table, with noise of Student's t."""
    lines = [names]
    for number, (times, told, seen) in enumerate(trials):
        seen = seen + rng.standard_t(4, seen.shape) / np.sqrt(2) * noise
        for time, goal, row in zip(times, told, seen, strict=True):
            cells = [time * tick, *goal * factor, *row * factor]
            cells += [number] if "trial" in names else []
            lines.append(",".join(f"{cell:.7g}" for cell in cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def halved(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model at half its step."""
    model.opt.timestep /= 2
    return model


def reacher(place: Path, rng, trials: int) -> Logged:
    """Motors without names; damping of joint1 raised by a quarter."""
    (place / "reacher.xml").write_text(ARM, encoding="utf-8")
    model = halved(mujoco.MjModel.from_xml_string(ARM))
    model.dof_damping[1] += 0.25
    made = [
        ran(model, steps(rng, 2, 0.02, 6), lambda d: d.qpos[:2].copy(), 6, 100)
        for _ in range(trials)
    ]
    written(place / "log.csv", "time,u0,u1,q0,q1,trial", made, 0.002, rng)
    parts = {"q0": ("joint", "joint0"), "q1": ("joint", "joint1")}
    return Logged(place / "reacher.xml", place / "log.csv", (), parts)


def crane(place: Path, rng, trials: int) -> Logged:
    """Its parts called otherwise; the swing damped by 0.08 N m s/rad more."""
    (place / "crane.xml").write_text(CRANE, encoding="utf-8")
    model = halved(mujoco.MjModel.from_xml_string(CRANE))
    model.dof_damping[1] += 0.08
    made = [
        ran(
            model,
            steps(rng, 1, 0.4, 7),
            lambda d: np.array([d.qpos[0], d.site_xpos[0, 0]]),
            7,
            50,
        )
        for _ in range(trials)
    ]
    written(place / "log.csv", "time,goal,cart,bob,trial", made, 0.001, rng)
    parts = {"cart": ("joint", "rail"), "bob": ("site", "bob")}
    return Logged(place / "crane.xml", place / "log.csv", (), parts)


def leg(place: Path, rng, trials: int) -> Logged:
    """One long curve through a PD loop; the calf's friction raised to 0.6 N m."""
    (place / "leg.xml").write_text(LEG, encoding="utf-8")
    servos = LEG.replace("<motor", f'<position kp="{KP:g}" kv="{KD:g}"')
    model = halved(mujoco.MjModel.from_xml_string(servos))
    model.dof_frictionloss[2] = 0.6
    rate = rng.uniform(2.0, 4.0, 3)
    offset = np.array([0.3, 0.8, -1.8])

    def told(time: float) -> np.ndarray:
        sweep = np.sin(rate * time + 0.05 * time**2)
        return offset + np.array([0.3, 0.4, 0.6]) * sweep

    made = ran(model, told, lambda d: d.qpos.copy(), 6.0 * trials, 200)
    names = "time,hip_goal,thigh_goal,calf_goal,hip,thigh,calf"
    written(place / "log.csv", names, [made], 5e-4, rng)
    parts = {name: ("joint", f"FL_{name}_joint") for name in ("hip", "thigh", "calf")}
    words = ("--kp", f"{KP:g}", "--kd", f"{KD:g}")
    return Logged(place / "leg.xml", place / "log.csv", words, parts)


def quad(place: Path, rng, trials: int) -> Logged:
    """Degrees and milliseconds; a knee's servo with 0.7 of its stiffness."""
    model = halved(mujoco.MjModel.from_xml_path(str(QUAD / "scene.xml")))
    model.actuator_gainprm[2, 0] *= 0.7
    model.actuator_biasprm[2, 1] *= 0.7
    joints = [model.actuator(number).name for number in range(model.nu)]
    made = [
        ran(
            model,
            steps(rng, model.nu, 0.25, 3),
            lambda d: d.qpos[7:].copy(),
            3,
            50,
            pose=0,
        )
        for _ in range(trials)
    ]
    told = ",".join(f"goal_{name}" for name in joints)
    names = f"t_ms,{told},{','.join(joints)},trial"
    turned = 180 / np.pi
    written(place / "log.csv", names, made, 0.002, rng, factor=turned, tick=1e3)
    parts = {name: ("joint", name) for name in joints}
    return Logged(QUAD / "scene.xml", place / "log.csv", (), parts)


ROBOTS = {"reacher": reacher, "crane": crane, "leg": leg, "quad": quad}


SEED, TRIALS, FEW = 11, 6, 3


@bench(
    "robots that come from an MJCF and a log to a verdict without editing a file",
    bar="4 of 4",
)
def gap_describe(quick: bool) -> Result:
    """Describe and diagnose each; `quick`: describe only, shorter logs."""
    details = {}
    for number, (name, make) in enumerate(ROBOTS.items()):
        rng = np.random.default_rng([SEED, number])
        with tempfile.TemporaryDirectory() as place:
            logged = make(Path(place), rng, FEW if quick else TRIALS)
            details[name] = _tried(logged, Path(place), quick)
    good = sum(bool(row["holds"]) for row in details.values())
    return Result(
        figure=good,
        unit="of 4",
        holds=good == len(ROBOTS),
        n=len(ROBOTS),
        details=details,
    )


def _tried(logged: Logged, place: Path, quick: bool) -> dict[str, object]:
    begin = perf_counter()
    own, out = place / "own.toml", place / "out"
    words = [str(logged.model), str(logged.log), "--out", str(own), *logged.words]
    heard = _ran(["describe", *words])
    found = _parts(own) if own.exists() else {}
    row: dict[str, object] = {"channels": found == logged.parts, "holds": False}
    if own.exists() and not quick:
        words = [str(logged.log), "--model", str(own), "--out", str(out)]
        heard = _ran(["diagnose", *words, "--no-report", "--no-rerun"])
        row["said"] = heard.partition("\n")[0][:200]
    elif not own.exists():
        row["said"] = heard[:200]
    said = quick or (out / "diagnosis.json").is_file()
    row["holds"] = bool(row["channels"] and said)
    row["seconds"] = round(perf_counter() - begin, 1)
    return row


def _parts(own: Path) -> dict[str, tuple[str, str]]:
    from bns.gap.models.mjcf.config import OwnConfig

    seen = OwnConfig.read(own).seen
    return {item.channel.name: (item.quantity, item.part) for item in seen}


def _ran(words: list[str]) -> str:
    """What `bns gap` says to some words."""
    from bns.__main__ import main

    heard = io.StringIO()
    with contextlib.redirect_stdout(heard), contextlib.redirect_stderr(heard):
        main(["gap", *words])
    return heard.getvalue()
