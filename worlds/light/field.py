"""Light in the arena: `Lamp` and `LightField`, as data."""

from dataclasses import dataclass, field, fields

import numpy as np

from bns.errors import BnsError
from bns.worlds.checks import bounded

_BOUNDS = {  # low, high, unit; assumed: what a table top can hold
    "x": (-10.0, 10.0, "m"),
    "y": (-10.0, 10.0, "m"),
    "height": (0.0, 5.0, "m"),
    "power": (0.0, 1e4, "W"),
    "flicker_depth": (0.0, 1.0, "1"),
    "flicker_frequency": (0.0, 1e4, "Hz"),
}


@dataclass(frozen=True)
class Lamp:
    """A small lamp that shines alike in all directions.

    The dissertation says "a removable light fitting in the centre of the tracking
    area" (5.2.4) and no more: height and power are assumed, and the sensitivity of the
    sensors is matched to them (`bns.worlds.light.sensors`).

    Attributes:
        x, y: where it stands, in the world frame [m].
        height: of the source above the floor [m].
        power: radiated in the band that the sensors see [W].
        flicker_depth: share of the power that comes and goes, 0 to 1.
        flicker_frequency: of that [Hz]; 100 for a lamp on 50 Hz mains.

    Raises:
        OutOfBoundsError: a number outside its bounds.
    """

    x: float = 0.0
    y: float = 0.0
    height: float = 0.2
    power: float = 10.0
    flicker_depth: float = 0.0
    flicker_frequency: float = 100.0

    def __post_init__(self) -> None:
        for item in fields(self):
            low, high, unit = _BOUNDS[item.name]
            value = bounded(
                f"lamp {item.name}", getattr(self, item.name), low, high, unit
            )
            object.__setattr__(self, item.name, value)

    @property
    def position(self) -> np.ndarray:
        """Of the source in the world frame, shape ``(3,)`` [m]."""
        return np.array([self.x, self.y, self.height])


@dataclass(frozen=True)
class LightField:
    """All light of the arena.

    Attributes:
        lamps: one or more.
        ambient: irradiance that is everywhere, on every sensor alike [W/m2].

    Raises:
        BnsError: there is no lamp, or something else among them.
        OutOfBoundsError: a negative ambient light.
    """

    lamps: tuple[Lamp, ...] = field(default_factory=lambda: (Lamp(),))
    ambient: float = 0.02

    def __post_init__(self) -> None:
        lamps = (self.lamps,) if isinstance(self.lamps, Lamp) else tuple(self.lamps)
        if not lamps or not all(isinstance(lamp, Lamp) for lamp in lamps):
            raise BnsError(
                f"lights = {self.lamps!r} is not allowed: give one Lamp or more, for "
                "example Lamp(x=0.0, y=0.0, height=0.2, power=10.0)."
            )
        object.__setattr__(self, "lamps", lamps)
        ambient = bounded("ambient light", self.ambient, 0.0, 1e3, "W/m2")
        object.__setattr__(self, "ambient", ambient)

    @property
    def positions(self) -> np.ndarray:
        """Of the lamps in the world frame, shape ``(L, 3)`` [m]."""
        return np.stack([lamp.position for lamp in self.lamps])

    def law(self) -> dict[str, np.ndarray]:
        """The numbers of the light; shapes and units as in `bns.worlds.light.law`."""
        return {
            "lamp_position": self.positions,
            "lamp_power": np.array([lamp.power for lamp in self.lamps]),
            "flicker_depth": np.array([lamp.flicker_depth for lamp in self.lamps]),
            "flicker_frequency": np.array(
                [lamp.flicker_frequency for lamp in self.lamps]
            ),
            "ambient": np.array(self.ambient),
            "shadow_azimuth": np.array(0.0),
            "shadow_width": np.array(0.0),
            "shadow_transmission": np.array(1.0),
        }
