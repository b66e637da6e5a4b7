"""Lamps and the light of the room."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter


class LightAmbient(OpticsEffect):
    """Light is added that falls on all sensors alike."""

    name = "light_ambient"
    doc = "the room is brighter everywhere"
    source = "assumed: a window or the room's lamps"
    parameters = (
        Parameter(
            "added",
            unit="W/m2",
            nominal=0.0,
            low=0.0,
            high=100.0,
            doc="irradiance added; bounds assumed",
            example=0.3,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        return {**law, "ambient": law["ambient"] + self["added"]}


class LightDimmed(OpticsEffect):
    """The power of all lamps is scaled."""

    name = "light_dimmed"
    doc = "the lamps give less light"
    source = "assumed: a lamp that ages or a low supply"
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.0,
            high=10.0,
            doc="power after over power before; bounds assumed",
            example=0.5,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        return {**law, "lamp_power": law["lamp_power"] * self["factor"]}


class LightDisplaced(OpticsEffect):
    """All lamps are moved; the safety boundary and the task stay where they were."""

    name = "light_displaced"
    doc = "the light stands elsewhere"
    source = "assumed: a lamp that was pushed"
    parameters = (
        Parameter(
            "x",
            unit="m",
            nominal=0.0,
            low=-3.0,
            high=3.0,
            doc="shift along x; bounds assumed",
            example=0.2,
        ),
        Parameter(
            "y",
            unit="m",
            nominal=0.0,
            low=-3.0,
            high=3.0,
            doc="shift along y; bounds assumed",
            example=-0.1,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        shift = np.array([self["x"], self["y"], 0.0])
        return {**law, "lamp_position": law["lamp_position"] + shift}


class LightFlicker(OpticsEffect):
    """A share of the power of all lamps goes and comes as a sine does."""

    name = "light_flicker"
    doc = "the lamps flicker"
    source = "assumed: a lamp on mains, or a loose contact"
    parameters = (
        Parameter(
            "depth",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="share of the power that goes",
            example=0.5,
        ),
        Parameter(
            "frequency",
            unit="Hz",
            nominal=1.3,
            low=0.001,
            high=1000.0,
            doc="of the flicker; bounds assumed",
            example=1.3,
            scales=False,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
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
    """A sector seen from each lamp gets a share of its light less."""

    name = "light_shadow"
    doc = "a part of the arena lies in shadow"
    source = "assumed: somebody or something stands beside the lamp"
    parameters = (
        Parameter(
            "loss",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="share of the light that is kept off",
            example=0.8,
        ),
        Parameter(
            "azimuth",
            unit="rad",
            nominal=0.0,
            low=-3.2,
            high=3.2,
            doc="middle of the sector, seen from the lamp; half a turn",
            example=0.0,
            scales=False,
        ),
        Parameter(
            "width",
            unit="rad",
            nominal=1.0,
            low=0.001,
            high=6.2832,
            doc="of the sector; up to a full turn",
            example=1.0,
            scales=False,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """See `OpticsEffect.change`."""
        if self.is_nominal:
            return dict(law)
        return {
            **law,
            "shadow_azimuth": np.array(self["azimuth"]),
            "shadow_width": np.array(self["width"]),
            "shadow_transmission": np.array(1 - self["loss"]),
        }
