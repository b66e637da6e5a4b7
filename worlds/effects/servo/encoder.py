"""Encoder of a servo."""

from bns.worlds.effects.base import Parameter, ServoEffect


class ServoOffset(ServoEffect):
    """The encoder's zero is not where the lever hangs."""

    name = "servo_offset"
    stage = "sensor"
    number = "offset"
    doc = "the encoder reads a constant too much"
    source = "mounting of the horn on its splines; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=-0.5,
            high=0.5,
            doc="reading minus angle, added",
            example=0.05,
        ),
    )


class ServoQuantisation(ServoEffect):
    """The encoder reads in steps."""

    name = "servo_quantisation"
    stage = "sensor"
    number = "quantisation"
    doc = "the encoder reads in steps"
    source = "12-bit encoders have steps of 1.53 mrad; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "step",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.1,
            doc="step added to the nominal one",
            example=0.01,
        ),
    )
