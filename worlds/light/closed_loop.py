"""Robots that steer themselves: what they read in a trial, and who watches over them.

They are watched at the edge and near a lamp. Investigations B and C: a robot that comes
closer to the lamp than the safety boundary is stopped for good (5.2.3), and at the edge
of the arena it is turned to a random heading towards the centre and goes on. Both are
done by hand or by the tracking system: the robot stands, is turned where it stands, and
the cycle is lost.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bns import seeding
from bns.errors import UnknownNameError
from bns.worlds.active import Placed, Stages
from bns.worlds.checks import bounded
from bns.worlds.effects.base import OpticsEffect, SensorEffect
from bns.worlds.light import law as light_law
from bns.worlds.light.law import LightField, Screen
from bns.worlds.light.sensors import VIRTUAL, LightSensors
from bns.worlds.trial import Channel

LEAD = 0.075
"""s; so long before a command ends the robot is asked for its readings: it takes some
50 ms to answer (thesis 5.2.2). What it reads is what falls on it when it is asked."""


class Sensing:
    """Sensors of N robots, each with its own damage and its own noise.

    Args:
        field: lamps and ambient light.
        sensors: of the robot.
        stages: what holds for each robot in this trial.
        seeds: of each robot.
        trial: number of the trial.
        reads: how often the sensors are read at most, the start included.
        screen: what objects leave of the light.
        singles: whether each sensor is a channel of its own, beside the virtual two.
    """

    def __init__(
        self,
        field: LightField,
        sensors: LightSensors,
        stages: Sequence[Stages],
        *,
        seeds: Sequence[int],
        trial: int,
        reads: int,
        screen: Screen | None = None,
        singles: bool = False,
    ):
        self.sensors, self.screen = sensors, screen
        self._law = sensors.law(field)
        optics = [_of(item, OpticsEffect) for item in stages]
        self._optics = optics if any(optics) else []
        self._current: tuple | None = None  # which of those are on, and their law
        self._changes = [
            Changes(_of(item, SensorEffect), seed, trial)
            for item, seed in zip(stages, seeds, strict=True)
        ]
        shape = (len(stages), reads, len(sensors.names))
        self._noise = np.empty((2, *shape))
        for robot, seed in enumerate(seeds):
            rng = seeding.generator(seed, "world", trial, "sensors")
            # a read after the other, so that a shorter trial draws the same
            draws = rng.standard_normal((reads, 2, shape[2]))
            self._noise[:, robot] = draws.swapaxes(0, 1)
        self._raw, self._seen = np.empty(shape), np.empty(shape)
        self._times = np.empty(reads)
        self._singles = singles
        self.count = 0

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Of the record: the virtual two, then each single one if asked for."""
        names = self.sensors.names if self._singles else ()
        return VIRTUAL + tuple(Channel(name, "count") for name in names)

    @property
    def readings(self) -> np.ndarray:
        """All so far, shape ``(n, reads, channels)`` [counts]."""
        seen = self._seen[:, : self.count]
        virtual = self.sensors.virtual(seen)
        return np.concatenate([virtual, seen], axis=-1) if self._singles else virtual

    def read(self, time: float, poses: np.ndarray, moments: np.ndarray) -> np.ndarray:
        """Read the sensors once more.

        Args:
            time: at which the readings are there [s].
            poses: of the robots when they were taken, shape ``(n, 3)``; NaN = lost,
                its last reading is held.
            moments: when they were taken [s], shape ``(n,)``.

        Returns:
            The virtual sensors, shape ``(n, 2)`` [counts].
        """
        at = self.count
        law = self._law_at(time)
        lost = ~np.isfinite(poses).all(axis=1)  # robots that diverged
        if lost.any():
            poses = np.where(lost[:, None], 0.0, poses)
        light = light_law.irradiance(
            law, poses, moments, sight=self.sensors.sight, screen=self.screen
        )
        noise = (self._noise[0, :, at], self._noise[1, :, at])
        raw = light_law.counts(law, light, noise)
        if at:
            raw[lost] = self._raw[lost, at - 1]
        self._times[at] = time
        self._raw[:, at] = self._seen[:, at] = raw
        self.count = at + 1
        for robot, changes in enumerate(self._changes):
            if changes:
                self._seen[robot, at] = changes.last(
                    self._times[: at + 1],
                    self._raw[robot, : at + 1],
                    self.sensors.names,
                )
        return self.sensors.virtual(self._seen[:, at])

    def _law_at(self, time: float) -> dict[str, np.ndarray]:
        if not self._optics:
            return self._law
        now = np.array(time)
        on = tuple(
            tuple(item.effect for item in items if item.active(now))
            for items in self._optics
        )
        if self._current is None or self._current[0] != on:
            laws = [_changed(self._law, effects, self.sensors.names) for effects in on]
            self._current = on, light_law.stacked(laws)
        return self._current[1]


def _of(stages: Stages, kind: type) -> list[Placed]:
    return [item for item in stages.sensor if isinstance(item.effect, kind)]


def _changed(law: dict, effects: Sequence, names: tuple[str, ...]) -> dict:
    for effect in effects:
        law = effect.change(law, names)
    return law


class Changes:
    """The effects on one robot's readings, each with its own random stream.

    Args:
        effects: on sensors, with when they hold.
        seed, trial: of what is random.
    """

    def __init__(self, effects: Sequence[Placed], seed: int, trial: int):
        self._effects = [
            (item, rng, rng.bit_generator.state)
            for item in effects
            for rng in [item.generator(seed, trial)]
        ]

    def __bool__(self) -> bool:
        return bool(self._effects)

    def last(
        self, times: np.ndarray, readings: np.ndarray, names: tuple[str, ...]
    ) -> np.ndarray:
        """The last of the readings after all effects, ``(S,)``.

        Args:
            times: of all readings so far [s], ``(N,)``.
            readings: of each sensor, ``(N, S)`` [counts].
            names: of the sensors.

        Effects see all that was read so far: what they make of a reading depends on
        that one and those before it.
        """
        for item, rng, begin in self._effects:
            rng.bit_generator.state = begin
            effect: SensorEffect = item.effect
            readings = effect.apply(times, readings, names, item.active(times), rng)
        return readings[-1]


SPREAD = np.pi / 4
"""rad; a turned robot looks within this of the centre (or away from the lamp); assumed
"""

PERIOD = 0.1
"""s; how often the tracking system looks; assumed"""

DEEPER = 1e-4  # [m] a robot on its way out is left alone; assumed


class Call(NamedTuple):
    """Where a robot has to be stopped.

    Attributes:
        look: index of the look at which it is.
        reason: "edge" or "lamp".
        lamp: which lamp; -1 at the edge.
    """

    look: int
    reason: str
    lamp: int = -1


@dataclass(frozen=True)
class Supervisor:
    """The rules.

    Attributes:
        safety: a robot whose centre is nearer to a lamp is stopped [m]; 0 = never.
            The dissertation gives no number; assumed.
        at_lamp: "stop" = for the rest of the trial, "turn" = turned away, goes on.
        edge: a robot whose centre is nearer to the board's edge is turned [m];
            negative = it may leave. Assumed: its own radius and a margin.

    Raises:
        OutOfBoundsError, UnknownNameError: a value that is not allowed.
    """

    safety: float = 0.15
    at_lamp: str = "stop"
    edge: float = 0.08

    def __post_init__(self) -> None:
        bounded("safety boundary", self.safety, 0.0, 10.0, "m")
        bounded("edge margin", self.edge, -100.0, 10.0, "m")
        if self.at_lamp not in ("stop", "turn"):
            raise UnknownNameError("at_lamp", str(self.at_lamp), ("stop", "turn"))

    def calls(
        self, places: np.ndarray, lamps: np.ndarray, arena: tuple[float, float]
    ) -> dict[int, Call]:
        """The robots that have to be stopped, and where.

        Args:
            places: where each is at each look, shape ``(n, looks, 2)`` [m]; the first
                look is that before.
            lamps: where the lamps are, shape ``(L, 2)`` [m].
            arena: size of the board [m].

        Returns:
            The first call for each robot that has one. Robots on their way out are
            left alone.
        """
        depth = np.empty((*places.shape[:2], 1 + len(lamps)))  # [m]
        x, y = np.moveaxis(np.abs(places), -1, 0)
        half_x, half_y = arena[0] / 2 - self.edge, arena[1] / 2 - self.edge
        np.maximum(x - half_x, y - half_y, out=depth[..., 0])
        way = places[:, :, None] - lamps
        np.hypot(way[..., 0], way[..., 1], out=depth[..., 1:])
        np.subtract(self.safety, depth[..., 1:], out=depth[..., 1:])
        if not (depth > 0).any():
            return {}
        deeper = (depth[:, 1:] > 0) & (depth[:, 1:] - depth[:, :-1] > DEEPER)
        robots = np.flatnonzero(deeper.any(axis=(1, 2))).tolist()
        return {robot: self._first(deeper[robot]) for robot in robots}

    def _first(self, deeper: np.ndarray) -> Call:
        look = int(deeper.any(axis=1).argmax())
        which = int(deeper[look].nonzero()[0][-1])  # a lamp before the edge
        return Call(look + 1, "lamp" if which else "edge", which - 1)

    def heading(
        self,
        place: np.ndarray,
        lamp: np.ndarray | None,
        rng: np.random.Generator,
    ) -> float:
        """Where a turned robot looks [rad].

        Args:
            place: where it stands [m].
            lamp: the lamp that it is turned away from; None = towards the centre.
            rng: the only source of randomness.
        """
        way = -place if lamp is None else place - lamp
        return math.atan2(way[1], way[0]) + rng.uniform(-SPREAD, SPREAD)
