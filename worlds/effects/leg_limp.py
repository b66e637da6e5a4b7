"""Leg limp: a leg's servos give no torque."""

from typing import Any

from bns.models.legs import LEGS
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.legs import LEG_SET, chosen, read
from bns.worlds.physics import servo_joint


class LegLimp(BodyEffect):
    """The motors of a leg are off: nothing drives or brakes them but friction."""

    name = "leg_limp"
    doc = "the servos of legs give no torque"
    source = "an unpowered bridge is open; friction of the gears stays"
    robots = ("legged",)
    choices = (LEG_SET,)
    parameters = (
        Parameter(
            "loss",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="share of the motor that is off",
            example=1.0,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        for leg in read(self["legs"]):
            for actuator in chosen(spec, LEGS[leg - 1]):
                law, powered = servo_joint.read(actuator)
                powered *= 1.0 - self["loss"]
                servo_joint.write(spec, actuator, law, powered)

    def lost(self) -> frozenset[int]:
        return frozenset(read(self["legs"]) if self["loss"] > 0.5 else ())
