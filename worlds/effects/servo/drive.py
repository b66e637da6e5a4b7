"""Drive of a servo: goals, gain, limits and motor."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import NO_CURRENT_LIMIT, Law


class ServoDelay(ServoEffect):
    """Goals take effect later."""

    name = "servo_delay"
    stage = "command"
    number = "delay"
    doc = "goals take effect later than nominal"
    source = "time on the bus and in the firmware; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "delay",
            unit="s",
            nominal=0.0,
            low=-0.1,
            high=0.5,
            doc="time added, negative takes away; never below none",
            example=0.05,
        ),
    )


class ServoLag(ServoEffect):
    """Goals are followed through a first-order filter."""

    name = "servo_lag"
    stage = "command"
    number = "lag"
    doc = "goals are followed with a first-order lag"
    source = "first-order model assumed; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "time_constant",
            unit="s",
            nominal=0.0,
            low=-0.2,
            high=1.0,
            doc="time to 63 % of a step, added",
            example=0.05,
        ),
    )


class ServoGain(ServoEffect):
    """The firmware's proportional gain differs."""

    name = "servo_gain"
    stage = "actuator"
    number = "gain"
    doc = "the position gain differs from what is told"
    source = "the gain is a register of the servo that is easily misread"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.05,
            high=20.0,
            doc="gain over gain told; bounds assumed",
            example=0.7,
        ),
    )


class ServoDeadZone(ServoEffect):
    """The motor rests while the error is small."""

    name = "servo_dead_zone"
    stage = "actuator"
    number = "dead_zone"
    doc = "the motor rests while the error is small"
    source = "compliance margin or dead zone register of servo firmware; bounds assumed"
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.3,
            doc="error up to which it rests, added",
            example=0.02,
        ),
    )


class ServoDutyLimit(ServoEffect):
    """The drive gives a share of the supply at most."""

    name = "servo_duty_limit"
    stage = "actuator"
    number = "duty_limit"
    doc = "the drive saturates below the full supply"
    source = "overload protection and torque limits of servo firmware act on the duty"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.02,
            high=1.0,
            doc="largest duty over nominal; bounds assumed",
            example=0.3,
        ),
    )


class ServoCurrentLimit(ServoEffect):
    """The drive limits its current."""

    name = "servo_current_limit"
    stage = "actuator"
    doc = "the motor's current is limited"
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
    """The supply differs."""

    name = "servo_voltage"
    stage = "actuator"
    number = "voltage"
    doc = "the supply voltage differs from what is told"
    source = "duty times voltage drives the motor"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.3,
            high=3.0,
            doc="voltage over voltage told; bounds assumed",
            example=0.8,
        ),
    )


class ServoTorqueConstant(ServoEffect):
    """The motor's torque per current differs."""

    name = "servo_torque_constant"
    stage = "actuator"
    number = "torque_constant"
    doc = "the torque constant differs; the back-EMF follows it"
    source = "motor equation: torque kt i, back-EMF kt w"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.3,
            high=3.0,
            doc="torque constant over nominal; bounds assumed",
            example=0.8,
        ),
    )
