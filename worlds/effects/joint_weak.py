"""Joint weak: a joint's servo gives a share of its torque."""

from typing import Any

from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.legs import JOINT, chosen
from bns.worlds.physics import servo_joint


class JointWeak(BodyEffect):
    """At every error, and at most, the servo's torque is a share of what it was."""

    name = "joint_weak"
    doc = "the servo of a joint gives a share of its torque"
    source = "worn motor or gears; bounds assumed"
    robots = ("legged",)
    choices = (JOINT,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.02,
            high=1.0,
            doc="torque left over torque before",
            example=0.4,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        for actuator in chosen(spec, self["joint"]):
            law, powered = servo_joint.read(actuator)
            weak = {name: law[name] * self["factor"] for name in ("gain", "duty_limit")}
            servo_joint.write(spec, actuator, {**law, **weak}, powered)
