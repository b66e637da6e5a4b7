"""The directory of a walking robot, written from what is known of it.

Masses, inertias and the pose at rest are computed; what is assumed is the PhantomX's
where that has it. `numbers.toml` says which number is what.
"""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bns.errors import BnsError
from bns.models import ax12a, servo_numbers
from bns.models.directory import make, named, short, text, texts
from bns.models.new_legged import AX12A, CLEAR, Legged, looks, masses, pairs, shapes
from bns.models.servo_numbers import joint_numbers
from bns.storage import reading

FILES = {
    "{name}.xml": "legged.xml.jinja",
    "scene.xml": "legged_scene.xml.jinja",
    "robot.toml": "legged_robot.toml.jinja",
    "numbers.toml": "legged_numbers.toml.jinja",
}
FIXED = {
    "timestep": 0.004,  # [s]
    "friction_stiffness": 3,
    "contact_time": 0.01,  # [s]
    "foot_friction": 0.8,
}
"""as the PhantomX has them"""

STICKY = 0.5  # share of their torque that servos' dry friction may be; assumed
YIELD = 0.3  # [rad] by which servos may yield under the robot; assumed
GIVEN = "given to `bns models new-legged`"
ASSUMED = {
    "body_height": "0.4 times the width",
    "hip_length": "7/8 of the body's length",
    "hip_width": "the body's width",
    "middle_width": "as between the other hips",
    "stance_height": "what stands on the floor reaches 0.75 times its length down",
    "femur_angle": "level",
    "leg_spread": "45 deg",
    "leg_mass": "legs have 55 % of the mass together, PhantomX; with two joints 40 %",
    "stops": "80 deg, as examples/quad of the project",
}
"""what stands for numbers that were not given"""


def write(directory: Path, known: Legged) -> None:
    """Make the directory of a robot, named as the directory is.

    Raises:
        BnsError: a name that no model can have; something is there already; no such
            file of servos; a robot that does not stand.
        FormatError: a file of servos that is not as it should be.
    """
    name = named(directory)
    content = {
        "name": name,
        **asdict(known),
        **_places(known),
        **_angles(known),
        **masses(known),
        **shapes(known),
        **looks(known),
        **FIXED,
        **_servo(known),
        "pairs": pairs(known),
        "sources": _sources(known),
        "servo": AX12A if known.servo == AX12A else servo_numbers.LAW,
    }
    content["home"] = _home(known, content)
    files = texts(name, FILES, content)
    if known.servo != AX12A:
        files[servo_numbers.LAW] = reading.read_text(known.servo)
    make(directory, files)


def law(known: Legged) -> dict[str, float]:
    """The law of its servos; what their file does not have is the AX-12A's.

    Raises:
        BnsError: there is no such file.
        FormatError: the file is not as it should be.
    """
    if known.servo == AX12A:
        return ax12a.law()
    if not Path(known.servo).is_file():
        raise BnsError(
            f"servo = {known.servo} is neither {AX12A} nor a file: give the law of "
            "other servos as docs/your_robot.md says."
        )
    return ax12a.law() | servo_numbers.read(Path(known.servo))


def _servo(known: Legged) -> dict[str, float]:
    """Its servos as numbers of joints."""
    made = joint_numbers(law(known))
    if not made.friction < STICKY * made.torque_limit:
        raise BnsError(
            f"Servos of {made.torque_limit:.3g} N m hardly turn against dry friction "
            f"of {made.friction:.3g} N m: give `coulomb` in {known.servo}; what that "
            "does not say is the AX-12A's."
        )
    return {f"servo_{name}": short(value) for name, value in made._asdict().items()}


def _places(known: Legged) -> dict[str, Any]:
    """What the legs are called, and where they are on the body."""
    hips = {leg: short(list(place)) for leg, place in known.hips.items()}
    ahead, aside = hips["left_front"]
    return {
        "legs": known.names,
        "parts": tuple(known.lengths),
        "root": "coxa" if known.coxa_length else "hip",
        "hips": hips,
        "hip_length": 2 * ahead,
        "hip_width": 2 * aside,
        "middle_width": 2 * hips.get("left_middle", [0.0, 0.0])[1],
        "body_height": short(known.height),
        "stance_height": short(known.stance),
    }


def _angles(known: Legged) -> dict[str, Any]:
    """How the legs stand half-way, and the entries of quaternions that are this."""
    right, spread = math.pi / 2, known.leg_spread
    knee = known.outer == "tibia"
    made = {
        "front_heading": short(right - spread),
        "middle_heading": short(right),
        "rear_heading": short(right + spread),
        "femur_zero": known.femur_angle if knee else short(-known.slope),
        "knee_zero": short(-known.slope - known.femur_angle),
    }
    headings = {}
    for leg in known.names:
        side, _, row = leg.rpartition("_")
        headings[leg] = made[f"{row}_heading"] * (1 if side == "left" else -1)
    turns = {
        name.partition("_")[0]: math.sin(angle / 2) / angle if angle else 0.5
        for name, angle in made.items()
    }
    return {**made, "headings": headings, "turns": turns}


def _sources(known: Legged) -> dict[str, str]:
    """Who says so of what may be given, by name."""
    said = {
        name: words if getattr(known, name) == getattr(Legged, name) else GIVEN
        for name, words in ASSUMED.items()
    }
    knee = known.outer == "tibia"
    said["femur_zero"] = said["femur_angle" if knee else "stance_height"]
    said["radius"] = "a share of the leg's length, the PhantomX's"
    usual = "AX-12A at 11.1 V, models/ax12a of the project"
    said["servo"] = usual if known.servo == AX12A else servo_numbers.LAW
    return said


def _home(known: Legged, content: dict[str, Any]) -> list[str]:
    """The robot's configuration at rest.

    Raises:
        BnsError: it does not stand.
    """
    half_way = [0, 0, known.stance, 1, 0, 0, 0] + [0] * known.legs * len(known.lengths)
    rest = at_rest(text(FILES["{name}.xml"], {**content, "home": half_way}))
    for first, second in rest.touching:
        raise BnsError(
            f"At rest {first} touches {second}: give hips farther apart (--hip-length, "
            "--hip-width), a narrower body or shorter legs."
        )
    if rest.bend > YIELD:
        raise BnsError(
            f"Under {known.mass} kg the servos ({known.servo}) yield by "
            f"{rest.bend:.2g} rad: too weak for this robot. Give less mass, shorter "
            "legs, or stronger servos (--servo FILE, see docs/your_robot.md)."
        )
    if not rest.stands:
        raise BnsError(
            "Put down with all servos half-way the robot does not come to rest on its "
            "feet: give less mass, hips farther apart or other servos (--servo FILE)."
        )
    needed = max(known.height, known.thick) / 2 + CLEAR / 2
    if rest.height < needed:
        raise BnsError(
            f"At rest the hips stand {rest.height:.3g} m over the floor, body and "
            f"thighs need {needed:.3g} m: give a higher --stance-height, a lower "
            "--body-height or stronger servos."
        )
    return [f"{value:.7g}" for value in rest.qpos]


PATIENCE = 200.0  # [s] in which a robot comes to rest; dry friction lets it creep
LOOK = 1.0  # [s] over which it has to
STILL = 1e-6  # [m, rad] moved over that; slower = rests; assumed
UPRIGHT = 0.999  # cosine of half the angle that a robot that stands has turned; assumed


class Rest(NamedTuple):
    """What becomes of a robot that is put down.

    Attributes:
        qpos: its configuration at the end, as if it had not drifted.
        stands: whether it has come to rest, and upright.
        touching: geoms of its own that touch each other then.
    """

    qpos: np.ndarray
    stands: bool
    touching: tuple[tuple[str, str], ...]

    @property
    def height(self) -> float:
        """Of the base over the floor [m]."""
        return float(self.qpos[2])

    @property
    def bend(self) -> float:
        """By which the joint that yields most does [rad]."""
        return float(np.abs(self.qpos[7:]).max())


def at_rest(xml: str) -> Rest:
    """Put a robot on a floor in its `home` pose, with that pose's goals, and wait.

    Args:
        xml: the robot alone, its free joint first.
    """
    import mujoco

    spec = mujoco.MjSpec.from_string(xml)
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1], contype=0
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    still = False
    for _ in range(round(PATIENCE / LOOK)):
        before = data.qpos.copy()
        mujoco.mj_step(model, data, round(LOOK / model.opt.timestep))
        still = bool(np.abs(data.qpos - before).max() < STILL)
        if still or any(item.number for item in data.warning):
            break
    stands = still and bool(data.qpos[3] > UPRIGHT)
    return Rest(_straight(data.qpos), stands, _touching(model, data))


def _straight(qpos: np.ndarray) -> np.ndarray:
    """Without drift of place, heading and tilt, to a millionth."""
    made = np.round(qpos, 6) + 0.0  # -0 is 0
    made[[0, 1, 3, 4, 5, 6]] = [0, 0, 1, 0, 0, 0]
    return made


def _touching(model: Any, data: Any) -> tuple[tuple[str, str], ...]:
    floor = model.geom("floor").id
    return tuple(
        (model.geom(a).name, model.geom(b).name)
        for a, b in (contact.geom for contact in data.contact)
        if floor not in (a, b)
    )
