"""The servo law: what a position servo on a lever does with a goal, as named numbers.

    goal -> delay, lag -> error -> duty -> torque -> friction -> lever -> encoder

With the angle q from hanging, the speed w and the goal g as it arrives:

    duty     = clip(gain * error_gain * (g - (q + offset)), +-duty_limit)
    current  = clip((duty * voltage - torque_constant * w) / resistance, +-limit)
    motor    = torque_constant * current
    load     = -9.81 * lever * (mass + arm_mass / 2) * sin(q)
    budget   = coulomb + viscous |w| + stribeck exp(-|w| / stribeck_speed)
               + load_friction |motor - load|
    inertia  = mass (lever^2 + gyration^2) + arm_mass lever^2 / 3 + armature
    inertia dw/dt = motor + load + friction, friction = what stops w, within +-budget

Source: the form of duty, motor and friction budget is that of BAM (Duclusaud et al.,
"Extended friction models for the physics simulation of servo actuators", ICRA 2025);
delay, lag, dead zone, backlash, limits and encoder are added here.

In MuJoCo its numbers are those of a joint and a position actuator:

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

from bns.errors import BnsError, OutOfBoundsError, UnknownNameError
from bns.models import ax12a, servo_numbers
from bns.models.robot_model import RobotModel
from bns.models.servo_numbers import LAW, joint_numbers

GRAVITY = 9.81  # [m/s2]


class LawNumber(NamedTuple):
    """One number of the law.

    Attributes:
        unit: SI.
        low, high: what is physically sensible; effects and fits stay inside.
        doc: one line.
    """

    unit: str
    low: float
    high: float
    doc: str


NUMBERS: Mapping[str, LawNumber] = {
    "mass": LawNumber("kg", 0.0, 10.0, "at the end of the lever"),
    "arm_mass": LawNumber("kg", 0.0, 2.0, "of the lever itself, a uniform rod"),
    "lever": LawNumber("m", 0.01, 1.0, "from the axis to the mass"),
    "gyration": LawNumber("m", 0.0, 0.2, "radius of gyration of the mass itself"),
    "gain": LawNumber("1", 0.0, 2000.0, "proportional gain, in the firmware's units"),
    "error_gain": LawNumber("1/rad", 1e-5, 10.0, "duty per error at gain 1"),
    "voltage": LawNumber("V", 0.0, 60.0, "supply"),
    "torque_constant": LawNumber("N m/A", 0.01, 10.0, "after the gears"),
    "resistance": LawNumber("ohm", 0.05, 100.0, "of winding and driver"),
    "coulomb": LawNumber("N m", 0.0, 5.0, "dry friction"),
    "viscous": LawNumber("N m s/rad", 0.0, 5.0, "friction per speed"),
    "stribeck": LawNumber("N m", 0.0, 5.0, "dry friction that fades with speed"),
    "stribeck_speed": LawNumber("rad/s", 0.01, 10.0, "at which it has faded to 37 %"),
    "load_friction": LawNumber("1", 0.0, 0.9, "friction per transmitted torque"),
    "armature": LawNumber("kg m2", 0.0, 1.0, "rotor and gears, seen at the output"),
    "delay": LawNumber("s", 0.0, 1.0, "until a goal takes effect"),
    "lag": LawNumber("s", 0.0, 2.0, "time constant with which goals are followed"),
    "duty_limit": LawNumber("1", 0.0, 1.0, "largest share of the supply"),
    "current_limit": LawNumber("A", 0.0, 1e3, "largest current; 1000 is none"),
    "backlash": LawNumber("rad", 0.0, 0.5, "full play between gears and lever"),
    "dead_zone": LawNumber("rad", 0.0, 0.5, "error up to which the motor rests"),
    "offset": LawNumber("rad", -1.0, 1.0, "encoder reading minus angle"),
    "quantisation": LawNumber("rad", 0.0, 0.2, "step of the encoder's readings"),
}
NO_CURRENT_LIMIT = 1e3  # [A]

Law = dict[str, np.ndarray]
"""Values of all numbers by name; arrays that broadcast against each other."""


def law(values: Mapping[str, object]) -> Law:
    """All numbers of the law as arrays, checked.

    Args:
        values: every number by name, scalars or arrays.

    Raises:
        UnknownNameError: a name that is none of the law's, or one is missing.
        OutOfBoundsError: a value outside its bounds, or NaN.
    """
    for name in values:
        if name not in NUMBERS:
            raise UnknownNameError("number of the servo law", name, NUMBERS)
    missing = [name for name in NUMBERS if name not in values]
    if missing:
        raise UnknownNameError("value of the servo law", missing[0], values)
    made = {}
    for name, item in NUMBERS.items():
        array = np.asarray(values[name], dtype=np.float64)
        bad = ~((array >= item.low) & (array <= item.high))
        if bad.any():
            given = array[bad].ravel()[0]
            raise OutOfBoundsError(
                f"servo {name}", given, item.low, item.high, item.unit
            )
        made[name] = array
    return made


def clipped(name: str, value: np.ndarray) -> np.ndarray:
    """A number of the law pulled back to its bounds.

    Args:
        name: of the number.
        value: of any shape, in the number's unit.

    Returns:
        like `value`.
    """
    return np.clip(value, NUMBERS[name].low, NUMBERS[name].high)


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
