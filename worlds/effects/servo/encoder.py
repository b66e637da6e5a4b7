"""Encoder of a servo."""

from bns.worlds.effects.base import ServoEffect, strength


class ServoOffset(ServoEffect):
    """The encoder reads a constant too much."""

    name = "servo_offset"
    stage = "sensor"
    number = "offset"
    source = "mounting of the horn on its splines; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        strength(
            "angle", "rad", (-0.5, 0.5), "reading minus angle, added", example=0.05
        ),
    )


class ServoQuantisation(ServoEffect):
    """The encoder reads in steps."""

    name = "servo_quantisation"
    stage = "sensor"
    number = "quantisation"
    source = "12-bit encoders have steps of 1.53 mrad; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        strength(
            "step", "rad", (0.0, 0.1), "step added to the nominal one", example=0.01
        ),
    )
