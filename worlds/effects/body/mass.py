"""Masses that the model does not know, or knows elsewhere."""

from dataclasses import replace
from typing import Any

import numpy as np

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter, strength


def _place(name: str, nominal: float, low: float, high: float, doc: str) -> Parameter:
    return Parameter(
        name,
        unit="m",
        nominal=nominal,
        low=low,
        high=high,
        doc=doc,
        example=nominal,
        scales=False,
    )


class Payload(BodyEffect):
    """The robot carries a mass that the model does not know."""

    name = "payload"
    source = "parallel-axis theorem; a point mass is assumed"
    robots = ("wheeled", "legged")
    parameters = (
        strength(
            "mass",
            "kg",
            (0.0, 2.0),
            "mass carried (the Khepera III itself: 0.69 kg); bounds assumed",
            example=0.5,
        ),
        _place("x", 0.0, -0.065, 0.065, "ahead of the axle; bounds: the body's radius"),
        _place("y", 0.0, -0.065, 0.065, "to the left; bounds: the body's radius"),
        _place("z", 0.07, 0.0, 0.3, "above the floor; nominal: the top plate (69 mm)"),
    )

    def _write(self, spec: Any) -> None:
        body = bodies.base(spec)
        position = np.array([self["x"], self["y"], self["z"]])
        inertial = bodies.Inertial.of(spec, body).plus_point(self["mass"], position)
        inertial.write(body)


def _shift(name: str, doc: str, example: float) -> Parameter:
    return strength(name, "m", (-0.03, 0.03), doc, example=example)


class CentreOfMass(BodyEffect):
    """The base's centre of mass lies elsewhere than in the model."""

    name = "centre_of_mass"
    source = "the model's 11 mm ahead of the axle has one source; bounds assumed"
    robots = ("wheeled", "legged")
    parameters = (
        _shift("dx", "shift forward; beyond -11 mm the Khepera leans back", 0.01),
        _shift("dy", "shift to the left", 0.01),
    )

    def _write(self, spec: Any) -> None:
        body = bodies.base(spec)
        inertial = bodies.Inertial.of(spec, body)
        centre = inertial.centre + np.array([self["dx"], self["dy"], 0.0])
        replace(inertial, centre=centre).write(body)
