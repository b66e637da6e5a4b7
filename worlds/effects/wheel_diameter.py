"""Wheel diameter: a wheel is larger or smaller than the model's."""

from typing import Any

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.common import WHEEL


class WheelDiameter(BodyEffect):
    """The wheel's rolling radius changes; the robot stays level.

    The wheel's axle is moved up on the body by as much as the radius grows, so that the
    wheel touches the floor where it did: the speed changes, the attitude does not (a
    true robot would lean by 0.13 deg for 1 % of one diameter), and the start pose needs
    no settling. The wheel's mass and inertia stay.
    """

    name = "wheel_diameter"
    doc = "a wheel is larger or smaller than the model's"
    source = "published diameters are 41, 42 and 42.4 mm (3 %); level attitude assumed"
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.7,
            high=1.3,
            doc="true diameter over the model's; bounds assumed",
            example=0.95,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        for side in self.wheels():
            body = bodies.wheel(spec, side)
            radius = max(geom.size[0] for geom in bodies.contact_geoms(body))
            for geom in body.geoms:
                geom.size[0] *= self["factor"]
            body.pos[2] += (self["factor"] - 1) * radius
