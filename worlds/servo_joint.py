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
from typing import Any, NamedTuple

import numpy as np

from bns.errors import BnsError
from bns.models import ax12a, servo_numbers
from bns.models.robot_model import RobotModel
from bns.models.servo_numbers import LAW
from bns.worlds.servo_law import NUMBERS, Law, law

STANCE_TORQUE = 0.38  # [N m] mean load of femur and tibia in the home stance
REFUSED = ("stribeck", "current_limit", "backlash", "dead_zone", "mass", "lever")
_STORED = (*NUMBERS, "powered")


class JointNumbers(NamedTuple):
    """What of a servo law a joint and its actuator hold.

    Attributes:
        stiffness: torque per error [N m/rad].
        torque_limit: of the motor at rest [N m].
        damping: back-EMF and viscous friction [N m s/rad].
        friction: dry friction [N m].
        armature: rotor and gears [kg m2].
    """

    stiffness: float
    torque_limit: float
    damping: float
    friction: float
    armature: float


def joint_numbers(values: Mapping[str, Any], powered: float = 1.0) -> JointNumbers:
    """A servo law as numbers of a joint.

    Args:
        values: every number of the law.
        powered: share of the motor that is connected; 0 = an open bridge, which does
            not brake either.
    """
    stall = values["torque_constant"] * values["voltage"] / values["resistance"]
    brake = values["torque_constant"] ** 2 / values["resistance"]
    return JointNumbers(
        stiffness=float(powered * stall * values["gain"] * values["error_gain"]),
        torque_limit=float(powered * stall * values["duty_limit"]),
        damping=float(powered * brake + values["viscous"]),
        friction=float(values["coulomb"] + values["load_friction"] * STANCE_TORQUE),
        armature=float(values["armature"]),
    )


def fit(spec: Any, robot: RobotModel) -> None:
    """Give a walking robot with servos of its own their law, see `RobotModel.servo`.

    Numbers that its `law.toml` does not have are the AX-12A's.

    Raises:
        FormatError: the file is not as it should be.
        BnsError: a number that is none of the law's, beyond its bounds, or that a joint
            can not represent.
    """
    if robot.kind != "legged" or robot.servo != LAW:
        return
    own = law(ax12a.law() | servo_numbers.law(robot.directory))
    spec.nuser_actuator = len(_STORED)
    for command in robot.commands:
        write(spec, spec.actuator(command.actuator), own)


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

    Raises:
        BnsError: a number that a joint can not represent differs from nominal.
    """
    before, _ = read(actuator)
    for name in REFUSED:
        if values[name] != before[name]:
            raise BnsError(
                f"A walking robot's servos can not represent {name!r} of the servo "
                "law; take another effect (for play: loose_horn)."
            )
    made, joint = joint_numbers(values, powered), spec.joint(actuator.target)
    actuator.gainprm[0] = made.stiffness
    actuator.biasprm[1] = -made.stiffness
    actuator.forcerange = [-made.torque_limit, made.torque_limit]
    joint.damping[0] = made.damping
    joint.frictionloss = made.friction
    joint.armature = made.armature
    actuator.userdata = [*(float(values[name]) for name in NUMBERS), powered]


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
