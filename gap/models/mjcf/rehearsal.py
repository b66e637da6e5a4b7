"""How every part of a model moves under recorded commands, to tell columns by it."""

from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from bns.gap.models.mjcf import prepared, view
from bns.gap.models.mjcf.described import AXES, TURNS
from bns.worlds.data.units import per_si

JOINT, SITE, BODY, SPEED, TENDON = "joint", "site", "body", "speed", "tendon"
GYRO = "gyro"
STATE = (
    "qpos",
    "qvel",
    "ten_length",
    "site_xpos",
    "site_xmat",
    "xpos",
    "xmat",
    "sensordata",
)
"""what `mujoco.MjData` calls the motion of joints, tendons, sites and bodies, and what
sensors read"""
OWN = 0.03  # by which a joint is preferred to a place that moves alike
STILL = 1e-6  # [m or rad] less is no motion


class Part(NamedTuple):
    """What a column may be of: a joint's position or speed, a place along an axis or
    how it is turned there, the length of a tendon, what a gyro reads about an axis."""

    quantity: str
    name: str
    axis: str = ""


class Fit(NamedTuple):
    """How well a column agrees with a part's motion.

    Attributes:
        score: 1 = in all; correlation, less what unit and place do not explain.
        unit: of the column, "rad", "deg", "mm", ...
        correlation: of the column with the motion.
    """

    score: float
    unit: str
    correlation: float


def motions(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    actuators: list[int],
    times: np.ndarray,
    told: np.ndarray,
) -> dict[Part, np.ndarray]:
    """Positions of all joints, named sites, bodies and tendons at some times, and how
    they are turned, each ``(T,)``.

    Args:
        model: that moves.
        data: its state at the first time; is changed.
        actuators: numbers of those that are told.
        times: of the samples [s], increasing.
        told: command from each sample on, ``(T, len(actuators))``.
    """
    count = int(np.ceil((times[-1] - times[0]) / model.opt.timestep)) + 1
    at = times[0] + np.arange(count) * model.opt.timestep
    which = np.searchsorted(times, at + 1e-9, side="right") - 1
    due = np.searchsorted(at, times - 1e-9)
    rows = []
    for step in range(count):
        data.ctrl[actuators] = told[which[step]]
        mujoco.mj_forward(model, data) if step == 0 else None
        rows.append([np.copy(getattr(data, name)) for name in STATE])
        mujoco.mj_step(model, data)
    rows = [rows[at] for at in np.minimum(due, count - 1)]
    state = (np.stack(each) for each in zip(*rows, strict=True))
    return _by_part(model, dict(zip(STATE, state, strict=True)))


def _by_part(
    model: mujoco.MjModel, state: Mapping[str, np.ndarray]
) -> dict[Part, np.ndarray]:
    """The motion of each part, ``(T,)``, from `STATE`, ``(T, n, ...)`` each."""
    found = {}
    for number in range(model.njnt):
        joint = model.joint(number)
        if prepared.hinged(model, number) and joint.name:
            found[Part(JOINT, joint.name)] = state["qpos"][:, joint.qposadr[0]]
            found[Part(SPEED, joint.name)] = state["qvel"][:, joint.dofadr[0]]
    for number in range(model.ntendon):
        if name := model.tendon(number).name:
            found[Part(TENDON, name)] = state["ten_length"][:, number]
    for name in view.gyros(model):
        first = int(model.sensor(name).adr[0])
        for axis, letter in enumerate(AXES):
            found[Part(GYRO, name, letter)] = state["sensordata"][:, first + axis]
    for kind, count, places, frames in (
        (SITE, model.nsite, state["site_xpos"], state["site_xmat"]),
        (BODY, model.nbody, state["xpos"], state["xmat"]),
    ):
        for number in range(count):
            name = getattr(model, kind)(number).name
            if not name or name == "world":
                continue
            for axis, letter in enumerate(AXES):
                found[Part(kind, name, letter)] = places[:, number, axis]
            for turn in TURNS:
                turned = view.angle(frames[:, number], turn)
                found[Part(kind, name, turn)] = turned
    return found


def factors(model: mujoco.MjModel, part: Part) -> Mapping[str, float]:
    """What a part may be measured in, and how much of it makes one SI unit."""
    turning = part.axis in TURNS or part.quantity == GYRO
    if part.quantity in (JOINT, SPEED):
        turning = turns(model, part.name)
    name = "rad" if turning else "m"
    return per_si(f"{name}/s" if part.quantity in (SPEED, GYRO) else name)


def turns(model: mujoco.MjModel, joint: str) -> bool:
    """Whether a joint is a hinge."""
    return int(model.joint(joint).type[0]) == int(mujoco.mjtJoint.mjJNT_HINGE)


def fit(
    values: np.ndarray,
    moved: np.ndarray,
    units: Mapping[str, float],
    *,
    joint: bool,
    turning: bool = False,
) -> Fit:
    """How well samples agree with a motion, in the unit in which they do best.

    Args:
        values: samples, ``(T,)``; NaN where there is none.
        moved: the motion in SI units, ``(T,)``.
        units: that the samples may be in.
        joint: whether it is a joint's; these are preferred.
        turning: whether it is how something is turned: whole turns are none.
    """
    good = np.isfinite(values) & np.isfinite(moved)
    best = Fit(-np.inf, next(iter(units)), 0.0)
    if good.sum() < 5 or np.ptp(moved[good]) < STILL or not np.ptp(values[good]):
        return best
    made = moved[good]
    for name, factor in units.items():
        seen = values[good] / factor
        seen = np.unwrap(seen) if turning else seen
        correlation = float(np.corrcoef(seen, made)[0, 1])
        ratio = abs(np.log(seen.std() / made.std()))
        away = abs(seen.mean() - made.mean()) / made.std()
        score = abs(correlation) - 0.3 * ratio - 0.1 * min(away, 3.0) + OWN * joint
        if score > best.score:
            best = Fit(float(score), name, correlation)
    return best
