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
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from bns.errors import OutOfBoundsError, UnknownNameError

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
