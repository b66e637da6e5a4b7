"""Joint locked: a joint moves in a part of its range, or not at all."""

from typing import Any

from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.legs import JOINT

SLACK = 1e-4  # [rad] by which the stops stay apart, as MuJoCo needs


class JointLocked(BodyEffect):
    """The joint's end stops close in on one angle, where a seized joint stands.

    A trial starts with the joint there; setting in within a trial forces it there.
    """

    name = "joint_locked"
    doc = "a joint is seized at an angle, or moves in a part of its range"
    source = "bounds: end stops of the maker's robot"
    robots = ("legged",)
    choices = (JOINT,)
    parameters = (
        Parameter(
            "loss",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="share of the range that is lost; 1 = locked",
            example=1.0,
        ),
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=-1.5,
            high=1.5,
            doc="where it stands, from half-way; beyond an end stop: there",
            example=0.3,
            scales=False,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        joint = spec.joint(self["joint"])
        low, high = joint.range
        angle, loss = min(max(self["angle"], low), high), self["loss"]
        joint.range = [
            low + loss * (angle - low) - SLACK,
            high + loss * (angle - high) + SLACK,
        ]
