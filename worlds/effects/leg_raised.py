"""Leg raised: a leg is held up, whatever it is told."""

import numpy as np

from bns.models.legs import LEGS, parts
from bns.worlds.effects.base import CommandEffect, ControlSignal, Parameter
from bns.worlds.effects.legs import LEG_SET, read

RAISED = {"coxa": 0.0, "femur": 1.3, "tibia": 0.0}  # [rad] foot 0.1 m above the hip


class LegRaised(CommandEffect):
    """A raised pose replaces the legs' goals, before the first command as well."""

    name = "leg_raised"
    doc = "legs are held up where they cannot touch the ground"
    source = "thesis 7.2.2: commands altered to raise the leg; the pose is assumed"
    robots = ("legged",)
    choices = (LEG_SET,)
    parameters = (
        Parameter(
            "blend",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="from the pose told (0) to the raised pose (1)",
            example=1.0,
        ),
    )

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        values = signal.values.copy()
        if self.is_nominal:
            return values
        for leg in read(self["legs"]):
            for part in parts(signal.channels):
                column = signal.column(f"{LEGS[leg - 1]}_{part}")
                told = values[active, column]
                values[active, column] += self["blend"] * (RAISED[part] - told)
        return values

    def lost(self) -> frozenset[int]:
        return frozenset(read(self["legs"]) if self["blend"] > 0.5 else ())
