"""How light becomes counts: one law, its numbers by name, all robots at once.

A law is a mapping of arrays. Each has the shape given here, or the same with a leading
robot axis, where robots differ (each with its own damage):

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

import numpy as np

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
