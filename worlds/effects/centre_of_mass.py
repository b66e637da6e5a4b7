"""Centre of mass: the base's lies elsewhere than in the model."""

from dataclasses import replace
from typing import Any

import numpy as np

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter


def _shift(name: str, doc: str, example: float) -> Parameter:
    return Parameter(
        name, unit="m", nominal=0.0, low=-0.03, high=0.03, doc=doc, example=example
    )


class CentreOfMass(BodyEffect):
    """The base's centre of mass is moved; mass and inertia about it stay."""

    name = "centre_of_mass"
    doc = "the base's centre of mass lies elsewhere than in the model"
    source = "the model's 11 mm ahead of the axle has one source; bounds assumed"
    robots = ("wheeled", "legged")
    parameters = (
        _shift("dx", "shift forward; beyond -11 mm the Khepera leans back", 0.01),
        _shift("dy", "shift to the left", 0.01),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        body = bodies.base(spec)
        inertial = bodies.Inertial.of(spec, body)
        centre = inertial.centre + np.array([self["dx"], self["dy"], 0.0])
        replace(inertial, centre=centre).write(body)
