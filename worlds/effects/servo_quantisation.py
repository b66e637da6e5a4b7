"""Servo quantisation: the encoder reads in steps."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoQuantisation(ServoEffect):
    """The encoder reads in steps."""

    name = "servo_quantisation"
    stage = "sensor"
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

    def change(self, law: Law) -> Law:
        value = clipped("quantisation", law["quantisation"] + self["step"])
        return {**law, "quantisation": value}
