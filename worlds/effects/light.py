"""The light law: lamps, the light of the room, and sensors dead, bent or noisy."""

import numpy as np

from bns.worlds.effects.base import OpticsEffect, factor, place, strength
from bns.worlds.effects.sensors import SENSOR, columns
from bns.worlds.light.law import Law


class LightAmbient(OpticsEffect):
    """The room is brighter everywhere."""

    name = "light_ambient"
    source = "assumed: a window or the room's lamps"
    parameter = strength(
        "added", "W/m2", (0.0, 100.0), "irradiance added; bounds assumed", example=0.3
    )

    def change(self, law: Law, sensors: tuple[str, ...]) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        return {**law, "ambient": law["ambient"] + self["added"]}


class LightDimmed(OpticsEffect):
    """The lamps give less light."""

    name = "light_dimmed"
    source = "assumed: a lamp that ages or a low supply"
    parameter = factor(
        (0.0, 10.0), "power after over power before; bounds assumed", example=0.5
    )

    def change(self, law: Law, sensors: tuple[str, ...]) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        return {**law, "lamp_power": law["lamp_power"] * self["factor"]}


class LightDisplaced(OpticsEffect):
    """The light stands elsewhere."""

    name = "light_displaced"
    source = "assumed: a lamp that was pushed"
    parameters = (
        strength("x", "m", (-3.0, 3.0), "shift along x; bounds assumed", example=0.2),
        strength("y", "m", (-3.0, 3.0), "shift along y; bounds assumed", example=-0.1),
    )

    def change(self, law: Law, sensors: tuple[str, ...]) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        shift = np.array([self["x"], self["y"], 0.0])
        return {**law, "lamp_position": law["lamp_position"] + shift}


class LightFlicker(OpticsEffect):
    """The lamps flicker."""

    name = "light_flicker"
    source = "assumed: a lamp on mains, or a loose contact"
    parameters = (
        strength("depth", "1", (0.0, 1.0), "share of the power that goes", example=0.5),
        place(
            "frequency", "Hz", 1.3, (0.001, 1000.0), "of the flicker; bounds assumed"
        ),
    )

    def change(self, law: Law, sensors: tuple[str, ...]) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        lamps = np.ones_like(law["lamp_power"])
        if self.is_nominal:
            return dict(law)
        return {
            **law,
            "flicker_depth": self["depth"] * lamps,
            "flicker_frequency": self["frequency"] * lamps,
        }


class LightShadow(OpticsEffect):
    """A part of the arena lies in shadow."""

    name = "light_shadow"
    source = "assumed: somebody or something stands beside the lamp"
    parameters = (
        strength(
            "loss", "1", (0.0, 1.0), "share of the light that is kept off", example=0.8
        ),
        strength(
            "azimuth",
            "rad",
            (-3.2, 3.2),
            "middle of the sector, seen from the lamp; half a turn",
            example=0.0,
            scales=False,
        ),
        place("width", "rad", 1.0, (0.001, 6.2832), "of the sector; up to a full turn"),
    )

    def change(self, law: Law, sensors: tuple[str, ...]) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        if self.is_nominal:
            return dict(law)
        return {
            **law,
            "shadow_azimuth": np.array(self["azimuth"]),
            "shadow_width": np.array(self["width"]),
            "shadow_transmission": np.array(1 - self["loss"]),
        }


class SensorDead(OpticsEffect):
    """A sensor answers to a share of the light or to none."""

    name = "sensor_dead"
    source = "assumed: a covered, dirty or broken phototransistor"
    choices = (SENSOR,)
    parameter = strength(
        "loss",
        "1",
        (0.0, 1.0),
        "share of its light that is lost; 1 = dead",
        example=1.0,
    )

    def change(self, law: Law, sensors: tuple[str, ...]) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        gain = law["sensitivity"].copy()
        gain[columns(self, sensors)] *= 1 - self["loss"]
        return {**law, "sensitivity": gain}


class SensorMisaligned(OpticsEffect):
    """A sensor looks aside."""

    name = "sensor_misaligned"
    source = "assumed: a bent sensor"
    choices = (SENSOR,)
    parameter = strength(
        "angle",
        "rad",
        (-3.2, 3.2),
        "added to its heading, counter-clockwise; half a turn",
        example=0.5,
    )

    def change(self, law: Law, sensors: tuple[str, ...]) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        heading = law["heading"].copy()
        heading[columns(self, sensors)] += self["angle"]
        return {**law, "heading": heading}


class SensorNoise(OpticsEffect):
    """A sensor's readings scatter more."""

    name = "sensor_noise"
    source = "thesis 6.2.1, 6.3.1: the noise found is doubled; what was found is silent"
    choices = (SENSOR,)
    parameter = factor(
        (0.0, 20.0), "noise after over noise before; bounds assumed", example=2.0
    )

    def change(self, law: Law, sensors: tuple[str, ...]) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        noise = law["noise"].copy()
        noise[columns(self, sensors)] *= self["factor"]
        return {**law, "noise": noise}
