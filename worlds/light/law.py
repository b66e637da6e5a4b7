"""Light: lamps in the arena as data, and the law by which light becomes counts.

The law holds for all robots at once, its numbers by name. A law is a mapping of arrays.
Each has the shape given here, or the same with a leading robot axis, where robots
differ (each with its own damage):

    lamp_position (L, 3) [m], lamp_power (L,) [W], flicker_depth (L,),
    flicker_frequency (L,) [Hz], ambient () [W/m2],
    shadow_azimuth () [rad], shadow_width () [rad], shadow_transmission (),
    position (S, 3) [m], heading (S,) [rad], exponent (), full_light (S,) [W/m2],
    dark () and bright () [counts], light_noise (), count_noise () [counts], noise (S,),
    sensitivity (S,)

The irradiance on a sensor falls with the square of the distance and with a power of
the cosine of the angle to where it looks (the exponent); the reading falls in
proportion from `dark` to `bright`, which it reaches at `full_light`: smaller is
brighter. Noise acts on the light and on the reading before it saturates, so that a
saturated sensor repeats itself; `noise` scales both noises. `sensitivity` scales the
light on a sensor.
"""

from collections.abc import Callable, Mapping, Sequence
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


Law = Mapping[str, np.ndarray]
Sight = Callable[[np.ndarray], np.ndarray]
"""Which share of a direction's light reaches the sensors: takes unit vectors in the
robot's frame, shape ``(..., S, L, 3)``, gives ``(..., S, L)``."""
Screen = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Which share of the lamps' light passes the objects: takes points ``(..., S, 3)`` and
lamps ``(..., L, 3)`` in the world frame, gives ``(..., S, L)``."""


def irradiance(
    law: Law,
    poses: np.ndarray,
    times: np.ndarray | float = 0.0,
    *,
    sight: Sight | None = None,
    screen: Screen | None = None,
) -> np.ndarray:
    """Light on each sensor.

    Args:
        law: see the module's docstring.
        poses: of the robots in the world frame, shape ``(n, 3)`` [m, m, rad].
        times: moment of each robot's reading [s], shape ``(n,)`` or one for all.
        sight: what the robot's own body leaves of a direction.
        screen: what objects leave of a lamp.

    Returns:
        Irradiance weighted by the angular response, shape ``(n, S)`` [W/m2].
    """
    poses = np.asarray(poses, dtype=np.float64)
    lamps, height = _lamps_in_body(law, poses)
    place, look = law["position"], law["heading"]
    x = lamps[..., 0][:, None] - place[..., 0, None]  # from sensor to lamp, (n, S, L)
    y = lamps[..., 1][:, None] - place[..., 1, None]
    z = height[..., None, :] - place[..., 2, None]
    square = np.maximum(x * x + y * y + z * z, 1e-6)  # [m2] no nearer than 1 mm
    ahead = x * np.cos(look)[..., None] + y * np.sin(look)[..., None]
    exponent = law["exponent"][..., None, None]
    light = np.maximum(ahead, 0.0) ** exponent / square ** (exponent / 2)
    light = light * _shining(law, times) / (4 * np.pi * square)
    if sight is not None:
        unit = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
        light = light * sight(unit / np.sqrt(square)[..., None])
    if screen is not None:
        given = law["lamp_position"]
        where = np.broadcast_to(given, (len(poses), *given.shape[-2:]))
        light = light * screen(_points(law, poses), where)
    if law["shadow_width"].any():
        light = light * _shadow(law, poses)
    return (light.sum(-1) + law["ambient"][..., None]) * law["sensitivity"]


def counts(
    law: Law, light: np.ndarray, noise: tuple[np.ndarray, np.ndarray] | None = None
) -> np.ndarray:
    """Readings from irradiance: smaller is brighter.

    Args:
        law: see the module's docstring.
        light: shape ``(n, S)`` [W/m2].
        noise: two arrays of standard normal numbers, ``(n, S)`` each; None = none.

    Returns:
        Whole counts, shape ``(n, S)``.
    """
    dark, bright = law["dark"][..., None], law["bright"][..., None]
    if noise is not None:
        scale = law["noise"]
        light = light * (1 + scale * law["light_noise"][..., None] * noise[0])
    reading = dark - (dark - bright) * light / law["full_light"]
    if noise is not None:
        reading = reading + scale * law["count_noise"][..., None] * noise[1]
    return np.rint(np.clip(reading, bright, dark))


def _points(law: Law, poses: np.ndarray) -> np.ndarray:
    """Where the sensors are, in the world frame, ``(n, S, 3)``."""
    place = law["position"]
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    points = np.empty((len(poses), *place.shape[-2:]))
    points[..., 0] = poses[:, 0, None] + cos * place[..., 0] - sin * place[..., 1]
    points[..., 1] = poses[:, 1, None] + sin * place[..., 0] + cos * place[..., 1]
    points[..., 2] = place[..., 2]
    return points


def _lamps_in_body(law: Law, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the lamps are from each robot: planar ``(n, L, 2)``, and their heights."""
    given = law["lamp_position"]
    way = given[..., :2] - poses[:, None, :2]
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    lamps = np.empty(way.shape)
    lamps[..., 0] = cos * way[..., 0] + sin * way[..., 1]
    lamps[..., 1] = cos * way[..., 1] - sin * way[..., 0]
    return lamps, given[..., 2]


def _shining(law: Law, times: np.ndarray | float) -> np.ndarray:
    """Power of each lamp at each robot's moment, broadcasts to ``(n, S, L)``."""
    if not law["flicker_depth"].any():
        return law["lamp_power"].reshape(-1, 1, law["lamp_power"].shape[-1])
    moment = np.asarray(times, dtype=np.float64).reshape(-1, 1)
    wave = 0.5 * (1 - np.cos(2 * np.pi * law["flicker_frequency"] * moment))
    return (law["lamp_power"] * (1 - law["flicker_depth"] * wave))[:, None, :]


def _shadow(law: Law, poses: np.ndarray) -> np.ndarray:
    """What passes where a shadow falls from the lamp, ``(n, S, L)``."""
    lamps = law["lamp_position"][..., None, :, :]
    way = _points(law, poses)[:, :, None] - lamps
    azimuth = np.arctan2(way[..., 1], way[..., 0])  # from the lamp to the sensor
    off = azimuth - law["shadow_azimuth"][..., None, None]
    off = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
    inside = off < law["shadow_width"][..., None, None] / 2
    return np.where(inside, law["shadow_transmission"][..., None, None], 1.0)


def stacked(laws: Sequence[Law]) -> dict[str, np.ndarray]:
    """The laws of several robots as one, each array with a leading robot axis."""
    return {name: np.stack([law[name] for law in laws]) for name in laws[0]}
