"""The task: drive to the lamp and stay at the goal radius (thesis 5.2.3)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.experiment.config import LightConfig
from bns.worlds.trial import Trial

BOARD = (2.7, 1.8)  # [m] the arena (thesis 4.2.1)
EDGE = 0.08  # [m] a robot is turned so near to the edge, as in the world; assumed
POOL = 4096


@dataclass(frozen=True)
class LightTask:
    """Equation 5.2 and what counts as solved.

    Attributes:
        lamp: where the lamp stands, x and y [m].
        config: radii and limits.
    """

    lamp: tuple[float, float]
    config: LightConfig

    @classmethod
    def of(cls, config: LightConfig) -> "LightTask":
        """The task of a configuration; its first lamp is the one to go to.

        Raises:
            BnsError: no lamp, one that cannot be read, or the first is off the board.
        """
        first = lamps(config)[0]
        x, y = first.get("x", 0.0), first.get("y", 0.0)
        if abs(x) > BOARD[0] / 2 or abs(y) > BOARD[1] / 2:
            raise BnsError(
                f"The first lamp, to which robots go, is at ({x:g}, {y:g}), off the "
                f"board of {BOARD[0]:g} m x {BOARD[1]:g} m around (0, 0): move it."
            )
        return cls((x, y), config)

    def cost(self, places: np.ndarray, stopped: np.ndarray | None = None) -> np.ndarray:
        """Equation 5.2 with its sign turned, for single executions.

        The dissertation maximises the negative sum over ten starts; here the cost of
        one is minimised (0 = best), and that of several is their mean, so that ten in
        the SNNs compare with one in the world.

        Args:
            places: after the start and after each cycle, ``(..., K + 1, 2)`` [m].
            stopped: cycles lost since somebody stopped the robot for good,
                ``(..., K)``; with `charge_stopped` = "start" they cost as the start
                would, with "far" as being the start's way beyond the goal. None =
                those that begin inside the safety boundary.

        Returns:
            ``(...)``: sum over the cycles of the distance from the goal radius, over
            the distance of the start from the lamp.
        """
        away = self.distances(places)
        if stopped is None:
            stopped = away[..., :-1] < self.config.safety
        begun, after = away[..., :1], away[..., 1:]
        if self.config.charge_stopped != "stand":
            beyond = self.config.goal if self.config.charge_stopped == "far" else 0.0
            after = np.where(stopped, begun + beyond, after)
        return np.abs(after - self.config.goal).sum(-1) / begun[..., 0]

    def distances(self, places: np.ndarray) -> np.ndarray:
        """Distance from the lamp [m], ``(..., K + 1)``."""
        return np.hypot(*np.moveaxis(places - np.asarray(self.lamp), -1, 0))

    def reached(self, places: np.ndarray) -> np.ndarray:
        """Whether robots came to the goal radius, ``(...)`` bool; places as `cost`."""
        return self.distances(places).min(-1) <= self.config.goal

    def solved(self, places: np.ndarray, handled: np.ndarray) -> bool:
        """Whether a robot circles the lamp.

        The dissertation judges by eye ("circling the light", figures 5.1 and 5.33).
        Read here: in the last `circle_cycles` cycles its distance from the goal radius
        is `circle_within` on average, it gets `circle_sweep` round the lamp, see
        `circling`, and nobody stopped or turned it.

        Args:
            places: ``(K + 1, 2)`` [m].
            handled: cycles in which somebody did, ``(K,)``.
        """
        config, (off, sweep) = self.config, self.circling(places)
        return bool(
            off <= config.circle_within
            and abs(sweep) >= np.radians(config.circle_sweep)
            and not handled[-config.circle_cycles :].any()
        )

    def circling(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How robots go round the lamp in the last `circle_cycles` cycles.

        Args:
            places: ``(..., K + 1, 2)`` [m].

        Returns:
            Mean distance from the goal radius [m], and how far round they get [rad],
            positive with the lamp on their left; each ``(...)``.
        """
        last = places[..., -self.config.circle_cycles - 1 :, :]
        off = np.abs(self.distances(last) - self.config.goal)[..., 1:].mean(-1)
        ahead, left = np.moveaxis(last - np.asarray(self.lamp), -1, 0)
        azimuth = np.unwrap(np.arctan2(left, ahead))
        return off, azimuth[..., -1] - azimuth[..., 0]

    def start_pool(self) -> np.ndarray:
        """Places of the lamp in the frames of robots that start anywhere.

        Uniform on the board, not near the lamp or the edge, looking anywhere, as
        trials in the world start; always the same pool.

        Returns:
            ``(POOL, 2)`` ahead and left [m].

        Raises:
            BnsError: the lamp leaves no room.
        """
        rng = seeding.generator(0, "light", "starts")
        half = np.asarray(BOARD) / 2 - EDGE
        place = rng.uniform(-half, half, (16 * POOL, 2))
        way = np.asarray(self.lamp) - place
        way = way[np.hypot(*way.T) >= self.config.start_nearest][:POOL]
        if len(way) < POOL:
            raise BnsError(
                f"light.start_nearest = {self.config.start_nearest} leaves hardly any "
                "place on the board; give a smaller one."
            )
        yaw = rng.uniform(-np.pi, np.pi, POOL)
        cos, sin = np.cos(yaw), np.sin(yaw)
        return np.stack(
            [cos * way[:, 0] + sin * way[:, 1], cos * way[:, 1] - sin * way[:, 0]], 1
        )


def lamps(config: LightConfig) -> list[dict[str, float]]:
    """The lamps of a configuration as fields with their values.

    Raises:
        BnsError: no lamp, or text that cannot be read.
    """
    if not config.lamps:
        raise BnsError('light.lamps is empty: give one or more, as "x=0,y=0".')
    return [_lamp(text) for text in config.lamps]


def _lamp(text: str) -> dict[str, float]:
    fields = {}
    for piece in filter(None, text.split(",")):
        key, _, value = piece.partition("=")
        try:
            fields[key.strip()] = float(value)
        except ValueError:
            raise BnsError(
                f"Lamp {text!r} cannot be read: give FIELD=NUMBER,... as in "
                '"x=0,y=0,height=0.2,power=10".'
            ) from None
    return fields


def places(trials: Sequence[Trial]) -> np.ndarray:
    """Positions at the start and after each cycle; a lost one is the last seen.

    Returns:
        ``(N, K + 1, 2)`` [m].
    """
    return np.stack([_filled(trial.command_poses_world[:, :2]) for trial in trials])


def lost(trials: Sequence[Trial]) -> np.ndarray:
    """Cycles from which on a robot was handled to the end: stopped, ``(N, K)`` bool.

    The cycle in which it was stopped was still its own.
    """
    handled = np.stack([trial.handled for trial in trials])
    since = np.logical_and.accumulate(handled[:, ::-1], axis=1)[:, ::-1]
    since[:, 1:] &= since[:, :-1].copy()
    since[:, 0] = False
    return since


def _filled(seen: np.ndarray) -> np.ndarray:
    known = np.isfinite(seen).all(1)
    first = int(known.argmax())  # a lost start is the first place seen
    last = np.maximum.accumulate(np.where(known, np.arange(len(seen)), first))
    return np.nan_to_num(seen[last])
