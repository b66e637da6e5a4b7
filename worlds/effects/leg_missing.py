"""Leg missing: a leg has come off."""

from typing import Any

from bns.models.legs import PARTS
from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.legs import LEG_SET, read
from bns.worlds.effects.legs import bodies as leg_bodies

LEFT = 1e-4  # share of mass and inertia that stays, so that the joints can be computed


class LegMissing(BodyEffect):
    """Coxa, femur and tibia weigh nothing and touch nothing; their servos go on."""

    name = "leg_missing"
    doc = "legs have come off"
    source = "masses of the model taken away; bounds by definition"
    robots = ("legged",)
    choices = (LEG_SET,)
    resizes = True  # its pairs of geoms go
    parameters = (
        Parameter(
            "loss",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="whether it is off",
            example=1.0,
            integer=True,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        gone = set()
        for part in PARTS:
            for body in leg_bodies(spec, self["legs"], part):
                body.mass *= LEFT
                body.inertia = [LEFT * value for value in body.inertia]
                for geom in bodies.contact_geoms(body):
                    geom.contype, geom.conaffinity = 0, 0
                    gone.add(geom.name)
        for pair in list(spec.pairs):
            if gone & {pair.geomname1, pair.geomname2}:
                spec.delete(pair)

    def lost(self) -> frozenset[int]:
        return frozenset(read(self["legs"]) if self["loss"] else ())
