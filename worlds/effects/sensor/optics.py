"""Light sensors themselves: dead, bent, or noisy."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, factor, strength
from bns.worlds.effects.sensors import SENSOR, columns


class SensorDead(OpticsEffect):
    """A sensor answers to a share of the light or to none."""

    name = "sensor_dead"
    source = "assumed: a covered, dirty or broken phototransistor"
    choices = (SENSOR,)
    parameters = (
        strength(
            "loss",
            "1",
            (0.0, 1.0),
            "share of its light that is lost; 1 = dead",
            example=1.0,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        gain = law["sensitivity"].copy()
        gain[columns(self, sensors)] *= 1 - self["loss"]
        return {**law, "sensitivity": gain}


class SensorMisaligned(OpticsEffect):
    """A sensor looks aside."""

    name = "sensor_misaligned"
    source = "assumed: a bent sensor"
    choices = (SENSOR,)
    parameters = (
        strength(
            "angle",
            "rad",
            (-3.2, 3.2),
            "added to its heading, counter-clockwise; half a turn",
            example=0.5,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        heading = law["heading"].copy()
        heading[columns(self, sensors)] += self["angle"]
        return {**law, "heading": heading}


class SensorNoise(OpticsEffect):
    """A sensor's readings scatter more."""

    name = "sensor_noise"
    source = "thesis 6.2.1, 6.3.1: the noise found is doubled; what was found is silent"
    choices = (SENSOR,)
    parameters = (
        factor(
            (0.0, 20.0), "noise after over noise before; bounds assumed", example=2.0
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        noise = law["noise"].copy()
        noise[columns(self, sensors)] *= self["factor"]
        return {**law, "noise": noise}
