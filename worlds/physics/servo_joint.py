"""The servo law in MuJoCo: its numbers as those of a joint and a position actuator.

    torque = clip(stiffness (goal - angle), +-torque_limit) - damping speed - friction

Only the actuator's part is limited, so a saturated servo still slows down along its
torque-speed line, as a motor does. What a joint can not hold acts on the goals (delay,
lag, offset, quantisation) or is not represented (`REFUSED`).

A model that an effect has changed carries the whole law of each servo in the actuator's
user data, so that effects compose, and so does that of a robot with servos of its own;
where there is none, the law of the AX-12A holds.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.models import ax12a, servo_numbers
from bns.models.robot_model import RobotModel
from bns.models.servo_numbers import LAW, joint_numbers
from bns.worlds.physics.servo_law import NUMBERS, Law, law

REFUSED = ("stribeck", "current_limit", "backlash", "dead_zone", "mass", "lever")
_STORED = (*NUMBERS, "powered")


def fit(spec: Any, robot: RobotModel) -> None:
    """Give a walking robot with servos of its own their law, see `RobotModel.servo`.

    Numbers that its `law.toml` does not have are the AX-12A's.

    Raises:
        FormatError: the file is not as it should be.
        BnsError: a number that is none of the law's, beyond its bounds, or that a joint
            can not represent.
    """
    made = law_of(robot)
    if made is None:
        return
    spec.nuser_actuator = len(_STORED)
    for command in robot.commands:
        write(spec, spec.actuator(command.actuator), made)


def law_of(robot: RobotModel) -> Law | None:
    """The law of a walking robot with servos of its own, see `own`; None: it has none.

    Raises:
        FormatError: its `law.toml` is not as it should be.
    """
    if robot.kind != "legged" or robot.servo != LAW:
        return None
    return own(servo_numbers.law(robot.directory))


def own(numbers: Mapping[str, float]) -> Law:
    """The law of a robot's own servos; what is not given is the AX-12A's.

    Raises:
        UnknownNameError: a number that is none of the law's.
        OutOfBoundsError: one beyond its bounds.
        BnsError: one that a joint can not represent.
    """
    made, usual = law(ax12a.law() | dict(numbers)), law(ax12a.law())
    _represented(made, usual)
    return made


def read(actuator: Any) -> tuple[Law, float]:
    """The law of a servo in an `MjSpec`, and how much of its motor is connected."""
    stored = np.array(actuator.userdata)
    if not stored.any():
        return law(ax12a.law()), 1.0
    named = dict(zip(_STORED, stored, strict=True))
    powered = named.pop("powered")
    return law(named), float(powered)


def write(spec: Any, actuator: Any, values: Law, powered: float = 1.0) -> None:
    """Write a law into an actuator and its joint.

    Args:
        spec: the `mujoco.MjSpec` that is written to.
        actuator: of the servo.
        values: numbers of the law by name.
        powered: share of the motor that is connected, 0..1.

    Raises:
        BnsError: a number that a joint can not represent differs from nominal.
    """
    before, _ = read(actuator)
    _represented(values, before)
    made, joint = joint_numbers(values, powered), spec.joint(actuator.target)
    actuator.gainprm[0] = made.stiffness
    actuator.biasprm[1] = -made.stiffness
    actuator.forcerange = [-made.torque_limit, made.torque_limit]
    joint.damping[0] = made.damping
    joint.frictionloss = made.friction
    joint.armature = made.armature
    actuator.userdata = [*(float(values[name]) for name in NUMBERS), powered]


def _represented(values: Law, before: Law) -> None:
    for name in REFUSED:
        if values[name] != before[name]:
            raise BnsError(
                f"A walking robot's servos can not represent {name!r} of the servo "
                "law; take another effect (for play: loose_horn)."
            )


def laws(model: Any) -> dict[str, np.ndarray]:
    """The laws of all servos of a compiled model, each number of shape ``(nu,)``.

    "powered" is among them.
    """
    base = {**ax12a.law(), "powered": 1.0}
    table = np.tile([base[name] for name in _STORED], (model.nu, 1))
    if model.nuser_actuator >= len(_STORED):
        given = model.actuator_user[:, : len(_STORED)]
        changed = given[:, _STORED.index("resistance")] > 0
        table[changed] = given[changed]
    return dict(zip(_STORED, table.T, strict=True))
