"""Whole legs: missing, limp, or held up."""

from typing import Any

import numpy as np

from bns.models.legs import LEGS, PARTS, parts
from bns.worlds.effects import bodies
from bns.worlds.effects.base import (
    BodyEffect,
    CommandEffect,
    ControlSignal,
    strength,
)
from bns.worlds.effects.leg_sets import LEG_SET, chosen, read
from bns.worlds.effects.leg_sets import bodies as leg_bodies
from bns.worlds.physics import servo_joint

LEFT = 1e-4  # share of mass and inertia that stays, so that the joints can be computed


class LegMissing(BodyEffect):
    """Legs have come off."""

    name = "leg_missing"
    source = "masses of the model taken away; bounds by definition"
    robots = ("legged",)
    choices = (LEG_SET,)
    resizes = True  # its pairs of geoms go
    parameters = (
        strength(
            "loss", "1", (0.0, 1.0), "whether it is off", example=1.0, integer=True
        ),
    )

    def _write(self, spec: Any) -> None:
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
        """See `Effect.lost`."""
        return frozenset(read(self["legs"]) if self["loss"] else ())


class LegLimp(BodyEffect):
    """The servos of legs give no torque."""

    name = "leg_limp"
    source = "an unpowered bridge is open; friction of the gears stays"
    robots = ("legged",)
    choices = (LEG_SET,)
    parameters = (
        strength(
            "loss", "1", (0.0, 1.0), "share of the motor that is off", example=1.0
        ),
    )

    def _write(self, spec: Any) -> None:
        for leg in read(self["legs"]):
            for actuator in chosen(spec, LEGS[leg - 1]):
                law, powered = servo_joint.read(actuator)
                powered *= 1.0 - self["loss"]
                servo_joint.write(spec, actuator, law, powered)

    def lost(self) -> frozenset[int]:
        """See `Effect.lost`."""
        return frozenset(read(self["legs"]) if self["loss"] > 0.5 else ())


RAISED = {"coxa": 0.0, "femur": 1.3, "tibia": 0.0}  # [rad] foot 0.1 m above the hip


class LegRaised(CommandEffect):
    """Legs are held up where they cannot touch the ground."""

    name = "leg_raised"
    source = "thesis 7.2.2: commands altered to raise the leg; the pose is assumed"
    robots = ("legged",)
    choices = (LEG_SET,)
    parameters = (
        strength(
            "blend",
            "1",
            (0.0, 1.0),
            "from the pose told (0) to the raised pose (1)",
            example=1.0,
        ),
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        values = signal.values
        for leg in read(self["legs"]):
            for part in parts(signal.channels):
                column = signal.column(f"{LEGS[leg - 1]}_{part}")
                told = values[active, column]
                values[active, column] += self["blend"] * (RAISED[part] - told)

    def lost(self) -> frozenset[int]:
        """See `Effect.lost`."""
        return frozenset(read(self["legs"]) if self["blend"] > 0.5 else ())
