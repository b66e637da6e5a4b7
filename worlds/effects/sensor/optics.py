"""Light sensors themselves: dead, bent, or noisy."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter
from bns.worlds.effects.sensors import SENSOR, columns


class SensorDead(OpticsEffect):
    """A share of the light on a sensor is lost; what is left is noise in the dark."""

    name = "sensor_dead"
    doc = "a sensor answers to a share of the light or to none"
    source = "assumed: a covered, dirty or broken phototransistor"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "loss",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="share of its light that is lost; 1 = dead",
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
    """A sensor is bent and looks elsewhere; where it sits does not change."""

    name = "sensor_misaligned"
    doc = "a sensor looks aside"
    source = "assumed: a bent sensor"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=-3.2,
            high=3.2,
            doc="added to its heading, counter-clockwise; half a turn",
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
    """The noise of a sensor is multiplied; a saturated reading still repeats itself."""

    name = "sensor_noise"
    doc = "a sensor's readings scatter more"
    source = "thesis 6.2.1, 6.3.1: the noise found is doubled; what was found is silent"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.0,
            high=20.0,
            doc="noise after over noise before; bounds assumed",
            example=2.0,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        noise = law["noise"].copy()
        noise[columns(self, sensors)] *= self["factor"]
        return {**law, "noise": noise}
