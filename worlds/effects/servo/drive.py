"""Drive of a servo: goals, gain, limits and motor."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import Parameter, ServoEffect, factor, strength
from bns.worlds.physics.servo_law import NO_CURRENT_LIMIT, Law


class ServoDelay(ServoEffect):
    """Goals take effect later than nominal."""

    name = "servo_delay"
    stage = "command"
    number = "delay"
    source = "time on the bus and in the firmware; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        strength(
            "delay",
            "s",
            (-0.1, 0.5),
            "time added, negative takes away; never below none",
            example=0.05,
        ),
    )


class ServoLag(ServoEffect):
    """Goals are followed with a first-order lag."""

    name = "servo_lag"
    stage = "command"
    number = "lag"
    source = "first-order model assumed; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        strength(
            "time_constant",
            "s",
            (-0.2, 1.0),
            "time to 63 % of a step, added",
            example=0.05,
        ),
    )


class ServoGain(ServoEffect):
    """The position gain differs from what is told."""

    name = "servo_gain"
    stage = "actuator"
    number = "gain"
    source = "the gain is a register of the servo that is easily misread"
    robots = ("servo", "legged")
    parameters = (
        factor((0.05, 20.0), "gain over gain told; bounds assumed", example=0.7),
    )


class ServoDeadZone(ServoEffect):
    """The motor rests while the error is small."""

    name = "servo_dead_zone"
    stage = "actuator"
    number = "dead_zone"
    source = "compliance margin or dead zone register of servo firmware; bounds assumed"
    parameters = (
        strength(
            "angle",
            "rad",
            (0.0, 0.3),
            "error up to which it rests, added",
            example=0.02,
        ),
    )


class ServoDutyLimit(ServoEffect):
    """The drive saturates below the full supply."""

    name = "servo_duty_limit"
    stage = "actuator"
    number = "duty_limit"
    source = "overload protection and torque limits of servo firmware act on the duty"
    robots = ("servo", "legged")
    parameters = (
        factor((0.02, 1.0), "largest duty over nominal; bounds assumed", example=0.3),
    )


class ServoCurrentLimit(ServoEffect):
    """The motor's current is limited."""

    name = "servo_current_limit"
    stage = "actuator"
    source = "current limits of servo firmware; bounds assumed"
    parameters = (
        Parameter(
            "current",
            unit="A",
            nominal=NO_CURRENT_LIMIT,
            low=0.01,
            high=NO_CURRENT_LIMIT,
            doc="largest current; 1000 is none; bounds assumed",
            example=0.2,
        ),
    )

    def change(self, law: Mapping[str, np.ndarray]) -> Law:
        """See `ServoEffect.change`."""
        value = np.minimum(law["current_limit"], self["current"])
        return {**law, "current_limit": value}


class ServoVoltage(ServoEffect):
    """The supply voltage differs from what is told."""

    name = "servo_voltage"
    stage = "actuator"
    number = "voltage"
    source = "duty times voltage drives the motor"
    robots = ("servo", "legged")
    parameters = (
        factor((0.3, 3.0), "voltage over voltage told; bounds assumed", example=0.8),
    )


class ServoTorqueConstant(ServoEffect):
    """The torque constant differs; the back-EMF follows it."""

    name = "servo_torque_constant"
    stage = "actuator"
    number = "torque_constant"
    source = "motor equation: torque kt i, back-EMF kt w"
    robots = ("servo", "legged")
    parameters = (
        factor((0.3, 3.0), "torque constant over nominal; bounds assumed", example=0.8),
    )
