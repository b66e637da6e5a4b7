"""Servos: goals, gain, limits and motor; friction, inertia, play, load and encoder."""

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
    parameter = strength(
        "delay",
        "s",
        (-0.1, 0.5),
        "time added, negative takes away; never below none",
        example=0.05,
    )


class ServoLag(ServoEffect):
    """Goals are followed with a first-order lag."""

    name = "servo_lag"
    stage = "command"
    number = "lag"
    source = "first-order model assumed; bounds assumed"
    robots = ("servo", "legged")
    parameter = strength(
        "time_constant", "s", (-0.2, 1.0), "time to 63 % of a step, added", example=0.05
    )


class ServoGain(ServoEffect):
    """The position gain differs from what is told."""

    name = "servo_gain"
    stage = "actuator"
    number = "gain"
    source = "the gain is a register of the servo that is easily misread"
    robots = ("servo", "legged")
    parameter = factor((0.05, 20.0), "gain over gain told; bounds assumed", example=0.7)


class ServoDeadZone(ServoEffect):
    """The motor rests while the error is small."""

    name = "servo_dead_zone"
    stage = "actuator"
    number = "dead_zone"
    source = "compliance margin or dead zone register of servo firmware; bounds assumed"
    parameter = strength(
        "angle", "rad", (0.0, 0.3), "error up to which it rests, added", example=0.02
    )


class ServoDutyLimit(ServoEffect):
    """The drive saturates below the full supply."""

    name = "servo_duty_limit"
    stage = "actuator"
    number = "duty_limit"
    source = "overload protection and torque limits of servo firmware act on the duty"
    robots = ("servo", "legged")
    parameter = factor(
        (0.02, 1.0), "largest duty over nominal; bounds assumed", example=0.3
    )


class ServoCurrentLimit(ServoEffect):
    """The motor's current is limited."""

    name = "servo_current_limit"
    stage = "actuator"
    source = "current limits of servo firmware; bounds assumed"
    parameter = Parameter(
        "current",
        unit="A",
        nominal=NO_CURRENT_LIMIT,
        low=0.01,
        high=NO_CURRENT_LIMIT,
        doc="largest current; 1000 is none; bounds assumed",
        example=0.2,
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
    parameter = factor(
        (0.3, 3.0), "voltage over voltage told; bounds assumed", example=0.8
    )


class ServoTorqueConstant(ServoEffect):
    """The torque constant differs; the back-EMF follows it."""

    name = "servo_torque_constant"
    stage = "actuator"
    number = "torque_constant"
    source = "motor equation: torque kt i, back-EMF kt w"
    robots = ("servo", "legged")
    parameter = factor(
        (0.3, 3.0), "torque constant over nominal; bounds assumed", example=0.8
    )


class ServoArmature(ServoEffect):
    """The rotor's inertia, seen at the output, differs."""

    name = "servo_armature"
    stage = "body"
    number = "armature"
    source = "rotor inertia times gear ratio squared; bounds assumed"
    robots = ("servo", "legged")
    parameter = strength(
        "inertia",
        "kg m2",
        (-0.1, 0.5),
        "inertia added, negative takes away",
        example=0.02,
    )


class ServoBacklash(ServoEffect):
    """Play between gears and lever."""

    name = "servo_backlash"
    stage = "body"
    number = "backlash"
    source = "two inertias that meet without a bounce; bounds assumed"
    parameter = strength("angle", "rad", (0.0, 0.3), "full play added", example=0.02)


class ServoCoulomb(ServoEffect):
    """Dry friction differs."""

    name = "servo_coulomb"
    stage = "body"
    number = "coulomb"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameter = strength(
        "torque",
        "N m",
        (-0.5, 1.0),
        "dry friction added, negative takes away",
        example=0.1,
    )


class ServoViscous(ServoEffect):
    """Viscous friction differs."""

    name = "servo_viscous"
    stage = "body"
    number = "viscous"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameter = strength(
        "coefficient",
        "N m s/rad",
        (-0.5, 2.0),
        "viscous friction added, negative takes away",
        example=0.1,
    )


class ServoStribeck(ServoEffect):
    """Extra dry friction at low speed (Stribeck)."""

    name = "servo_stribeck"
    stage = "body"
    number = "stribeck"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    parameter = strength(
        "torque",
        "N m",
        (-0.5, 1.0),
        "friction added at speed 0, negative takes away",
        example=0.1,
    )


class ServoLoadFriction(ServoEffect):
    """Gear friction in proportion to the load."""

    name = "servo_load_friction"
    stage = "body"
    number = "load_friction"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameter = strength(
        "coefficient",
        "1",
        (-0.5, 0.8),
        "friction per torque added, negative takes away",
        example=0.1,
    )


class ServoLever(ServoEffect):
    """The lever's length differs from what is told."""

    name = "servo_lever"
    stage = "body"
    number = "lever"
    source = "the whole lever is scaled, its mass stays"
    parameter = factor(
        (0.25, 4.0), "length over length told; bounds assumed", example=1.2
    )


class ServoPayload(ServoEffect):
    """The lifted mass differs from what is told."""

    name = "servo_payload"
    stage = "body"
    number = "mass"
    source = "a point mass at the end of the lever"
    parameter = strength(
        "mass",
        "kg",
        (-2.0, 5.0),
        "mass added, negative takes away; bounds assumed",
        example=0.2,
    )


class ServoOffset(ServoEffect):
    """The encoder reads a constant too much."""

    name = "servo_offset"
    stage = "sensor"
    number = "offset"
    source = "mounting of the horn on its splines; bounds assumed"
    robots = ("servo", "legged")
    parameter = strength(
        "angle", "rad", (-0.5, 0.5), "reading minus angle, added", example=0.05
    )


class ServoQuantisation(ServoEffect):
    """The encoder reads in steps."""

    name = "servo_quantisation"
    stage = "sensor"
    number = "quantisation"
    source = "12-bit encoders have steps of 1.53 mrad; bounds assumed"
    robots = ("servo", "legged")
    parameter = strength(
        "step", "rad", (0.0, 0.1), "step added to the nominal one", example=0.01
    )
