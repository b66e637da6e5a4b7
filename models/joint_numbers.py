"""A servo law as numbers of a joint and its position actuator.

    torque = clip(stiffness (goal - angle), +-torque_limit) - damping speed - friction

Only the actuator's part is limited, so a saturated servo still slows down along its
torque-speed line, as a motor does.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

STANCE_TORQUE = 0.38  # [N m] mean load of femur and tibia in the home stance


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
