"""Planar driving by a learnt map, of many robots at once; see `surrogate`."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

EVERY = 2  # physics steps per interval of the map
INTERVAL = 0.01  # [s] of an interval, of a physics step of 5 ms
TRACK = (
    0.045  # [m] half the track, scales a turning speed to a wheel's; any near will do
)
KNEE = 0.002  # [m/s] within which dry friction changes its sign; assumed
LATE = (
    0.75  # weight of an interval's last speed in the way travelled: the physics moves
)
# with the speed after each step, so two steps move with the middle and the last one
TERMS = 13
FASTEST = 20.0  # [m/s, rad/s] beyond it a drive has diverged


@dataclass(frozen=True, eq=False)
class Map:
    """From one interval to the next, of (forward speed [m/s], turning speed [rad/s]).

    Attributes:
        step: coefficients of the change, ``(TERMS, 2)``.
        wheel: speeds of both wheels (as commands) from the two speeds, ``(2, 2)``.
        side: coefficients of the sideways speed, ``(3,)``.
        limit: lag of each wheel beyond which its motor gives no more, ``(2,)`` [m/s].
    """

    step: np.ndarray
    wheel: np.ndarray
    side: np.ndarray
    limit: np.ndarray

    @classmethod
    def empty(cls) -> "Map":
        """One that goes nowhere."""
        return cls(np.zeros((TERMS, 2)), np.zeros((2, 2)), np.zeros(3), np.ones(2))


def mixed(maps: Sequence[Map], weights: Sequence[float]) -> Map:
    """Weighted sum of maps, the weights adding up to one."""
    rows = [
        sum(w * getattr(item, name) for item, w in zip(maps, weights, strict=True))
        for name in ("step", "wheel", "side")
    ]
    limits = np.array([item.limit for item in maps])
    if np.isinf(limits).any():
        return Map(*rows, limits.min(axis=0))
    return Map(*rows, np.maximum(np.asarray(weights) @ limits, 0.0))


def halved(told: np.ndarray) -> np.ndarray:
    """Speeds told per physics step ``(S, 2)`` by interval, ``(S / 2, 4)``.

    The mean of each wheel's over the interval, then half its change within.
    """
    missing = -len(told) % EVERY
    if missing:
        told = np.concatenate([told, np.repeat(told[-1:], missing, axis=0)])
    first, second = told[::EVERY], told[1::EVERY]
    return np.concatenate([first + second, second - first], axis=1) / 2


def pull(yaw: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Gravity along forward and left of a heading [rad], ``(S, 2)`` [m/s^2]."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    gx, gy, _ = gravity
    return np.column_stack([cos * gx + sin * gy, cos * gy - sin * gx])


def terms(
    speed: np.ndarray,
    wheel: np.ndarray,
    told: np.ndarray,
    pulled: np.ndarray,
    limit: np.ndarray,
) -> np.ndarray:
    """What the change of speed is linear in, of one drive: ``(S, TERMS)``.

    Args:
        speed: forward and turning speed, ``(S, 2)`` [m/s, rad/s].
        wheel: speeds of both wheels from the two speeds, ``(2, 2)``.
        told: speeds told, as `halved` gives them, ``(S, 4)`` [m/s]; the last two enter
            as they are.
        pulled: gravity along forward and left, ``(S, 2)`` [m/s^2].
        limit: lag of each wheel beyond which its motor gives no more, ``(2,)`` [m/s].
    """
    made = np.empty((TERMS, len(speed)))
    made[8] = 1.0
    made[9:11] = told[:, 2:].T
    made[11:] = pulled.T
    _fill(made, speed.T, (speed @ wheel).T, told[:, :2].T, limit[:, None])
    return made.T


def _fill(made, speed, wheels, told, limit) -> None:
    """Terms that depend on the speed, ``(TERMS, N)`` in place."""
    v, w = speed
    made[0] = v
    np.multiply(w, TRACK, out=made[1])
    np.subtract(told, wheels, out=made[2:4])
    np.minimum(made[2:4], limit, out=made[2:4])
    np.maximum(made[2:4], -limit, out=made[2:4])
    np.multiply(w, 0.01 * w, out=made[4])
    np.multiply(v, 0.1 * w, out=made[5])
    np.subtract(v, made[1], out=made[6])
    np.add(v, made[1], out=made[7])
    made[6:8] *= 1 / KNEE
    np.tanh(made[6:8], out=made[6:8])


def side_terms(speed: np.ndarray) -> np.ndarray:
    """What the sideways speed is linear in, ``(..., 3)``."""
    v, w = speed[..., 0], speed[..., 1]
    return np.stack([w, v * w, v], axis=-1)


def poses(
    maps: Sequence[Map], told: Sequence[np.ndarray], pulled: Sequence[np.ndarray | None]
) -> list[np.ndarray]:
    """Planar poses from rest at the origin, every `INTERVAL`.

    Args:
        maps: of each of N robots.
        told: wheel speeds told, as `halved` gives them, ``(S_n, 4)`` [m/s] each.
        pulled: gravity along forward and left, ``(S_n, 2)``; None = level floor.

    Returns:
        ``(S_n + 1, 3)`` each.
    """
    lengths = [len(values) for values in told]
    inputs = np.zeros((max(lengths), 4, len(maps)))
    tilted = any(values is not None for values in pulled)
    tilts = np.zeros((max(lengths) if tilted else 0, 2, len(maps)))
    for n, (given, values) in enumerate(zip(told, pulled, strict=True)):
        inputs[: len(given), :, n] = given
        if values is not None:
            tilts[: len(given), :, n] = values
    speed = _speeds(maps, inputs, tilts)
    side = np.stack([item.side for item in maps], axis=-1)
    v, w = speed[:, 0], speed[:, 1]
    left = side[0] * w + side[1] * v * w + side[2] * v
    yaw = np.zeros_like(w)
    yaw[1:] = np.cumsum(_over(w), axis=0)
    middle = (yaw[1:] + yaw[:-1]) / 2
    cos, sin = np.cos(middle), np.sin(middle)
    ahead, aside = _over(v), _over(left)
    path = np.zeros((*yaw.shape, 3))
    path[1:, :, 0] = np.cumsum(cos * ahead - sin * aside, axis=0)
    path[1:, :, 1] = np.cumsum(sin * ahead + cos * aside, axis=0)
    path[:, :, 2] = yaw
    return [path[: length + 1, n].copy() for n, length in enumerate(lengths)]


def _over(speed: np.ndarray) -> np.ndarray:
    """Way travelled in each interval."""
    return INTERVAL * ((1 - LATE) * speed[:-1] + LATE * speed[1:])


def _speeds(maps: Sequence[Map], told: np.ndarray, tilts: np.ndarray) -> np.ndarray:
    """Forward and turning speed, ``(S + 1, 2, N)``."""
    steps, _, count = told.shape
    used = TERMS if len(tilts) else TERMS - 2
    change = np.stack([item.step.T for item in maps], axis=-1)[:, :used].copy()
    wheel = np.stack([item.wheel for item in maps], axis=-1)
    limit = np.stack([item.limit for item in maps], axis=-1)
    speed = np.zeros((steps + 1, 2, count))
    made = np.ones((used, count))
    scratch = np.empty_like(change)
    for t in range(steps):
        now = speed[t]
        wheels = wheel[0] * now[0] + wheel[1] * now[1]
        made[9:11] = told[t, 2:]
        if len(tilts):
            made[11:] = tilts[t]
        _fill(made, now, wheels, told[t, :2], limit)
        np.multiply(change, made, out=scratch)
        scratch.sum(axis=1, out=speed[t + 1])
        speed[t + 1] += now
        np.minimum(speed[t + 1], FASTEST, out=speed[t + 1])
        np.maximum(speed[t + 1], -FASTEST, out=speed[t + 1])
    return speed
