"""Loose horn: play between a servo and what it moves."""

from typing import Any

import numpy as np

from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.legs import JOINT

ARMATURE = 1e-4  # [kg m2] of the play's joint, so that it can be computed; assumed
DAMPING = 1e-3  # [N m s/rad] in the play; assumed


class LooseHorn(BodyEffect):
    """A second joint behind the servo's moves freely between two stops.

    The servo reports its own shaft, not what the horn does.
    """

    name = "loose_horn"
    doc = "a loose horn: play between a servo and the part that it moves"
    source = "backlash as a joint of its own with stops; bounds assumed"
    robots = ("legged",)
    choices = (JOINT,)
    resizes = True
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.6,
            doc="full play",
            example=0.15,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        joint, half = spec.joint(self["joint"]), self["angle"] / 2
        name = f"{self['joint']}_play"
        if spec.joint(name) is not None:  # a second one widens it
            wide = spec.joint(name)
            wide.range = [wide.range[0] - half, wide.range[1] + half]
            return
        before = _place(spec, joint.name)
        joint.parent.add_joint(
            name=name,
            axis=joint.axis,
            range=[-half, half],
            limited=True,
            armature=ARMATURE,
            damping=[DAMPING, 0.0, 0.0],
        )
        for key in spec.keys:
            key.qpos = np.insert(np.array(key.qpos), before + 1, 0.0)


def _place(spec: Any, name: str) -> int:
    """Where in qpos a joint's angle lies."""
    model = spec.copy().compile()
    return int(model.jnt_qposadr[model.joint(name).id])
