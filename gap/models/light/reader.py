"""What light sensors read along poses that were seen, with effects: `Reader`.

Readings are a direct function of where the robot is, of the lamps and of the sensors
(`bns.worlds.light.law`), so no physics is run: the law is evaluated at the recorded
poses. What the sensors' own noise makes of a reading is drawn a few times, the same
draws for every effect, so that the mean and the scatter of what would have been read
are known also where readings saturate.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from bns import seeding
from bns.worlds.effects.base import Effect, OpticsEffect, SensorEffect
from bns.worlds.light import law as light_law
from bns.worlds.light.law import Law, LightField, Screen
from bns.worlds.light.sensors import LightSensors

DRAWS = 16  # of each reading's noise


@dataclass(frozen=True, eq=False)
class Reads:
    """Moments at which a robot's sensors were read.

    Attributes:
        times: at which the readings were there [s], from the trial's start, ``(T,)``.
        moments: when they were taken [s], ``(T,)``.
        poses: where the robot was then, ``(T, 3)`` [m, m, rad].
        first: what was read first, ``(R,)`` [counts].
    """

    times: np.ndarray
    moments: np.ndarray
    poses: np.ndarray
    first: np.ndarray


class Reader:
    """Reads what light sensors would have read.

    Args:
        field: lamps and ambient light.
        sensors: of the robot.
        singles: whether readings have each single sensor, else the virtual two alone.
        screen: what objects leave of the light.
        pose_sd: noise of the poses along which they are read [m, m, rad].
        draws: of each reading's noise.
    """

    def __init__(
        self,
        field: LightField,
        sensors: LightSensors,
        *,
        singles: bool,
        screen: Screen | None = None,
        pose_sd: Sequence[float] = (0.0, 0.0, 0.0),
        draws: int = DRAWS,
    ):
        self.field, self.sensors = field, sensors
        self.singles, self.screen, self.draws = singles, screen, draws
        self._law = sensors.law(field)
        self.pose_sd = np.array(pose_sd, dtype=float)
        self._plain: dict[bytes, np.ndarray] = {}  # draws without an effect
        self._unsure: dict[bytes, np.ndarray] = {}

    def expected(self, reads: Reads) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nominal readings, ``(T, R)`` [counts] each.

        Returns:
            mean; standard deviation; the same if nothing saturated, for light up to
            where it does.
        """
        law, light = self._law, self._light(self._law, reads, reads.poses)
        scale = (law["dark"] - law["bright"]) / law["full_light"]
        share = np.hypot(law["light_noise"], self.unsure(reads))
        free = share * scale * np.minimum(light, law["full_light"])
        free = np.hypot(free, law["count_noise"]) * law["noise"]
        spread = np.hypot(share * scale * light, law["count_noise"]) * law["noise"]
        mean = law["dark"] - scale * light
        mean, variance = _clipped(mean, spread, law["bright"], law["dark"])
        if self.singles:
            return mean, np.sqrt(variance), free
        mean, variance, free = map(self.sensors.virtual, (mean, variance, free**2))
        many = [len(side) for side in self.sensors.sides]
        return mean, np.sqrt(variance / many), np.sqrt(free / many)

    def unsure(self, reads: Reads) -> np.ndarray:
        """What noise of the pose adds to the light, as a share of it, ``(T, S)``."""
        key = reads.poses.tobytes()
        if key not in self._unsure:
            light = self._light(self._law, reads, reads.poses)
            ends = [
                self._light(self._law, reads, reads.poses + way)
                - self._light(self._law, reads, reads.poses - way)
                for way in np.diag(self.pose_sd)
                if way.any()
            ]
            moved = np.sqrt(sum((end / 2) ** 2 for end in ends) + 0 * light)
            self._unsure[key] = np.minimum(moved / np.maximum(light, 1e-9), 1.0)
        return self._unsure[key]

    def samples(self, reads: Reads, effects: Sequence[Effect]) -> np.ndarray:
        """Draws of what would have been read, ``(T, D, R)`` [counts].

        A frozen sensor repeats what was read first. That itself is read as if nothing
        was known of it: a sensor that always reads least did not freeze so.
        """
        raw = self._raw(reads, effects)
        changed = [item for item in effects if isinstance(item, SensorEffect)]
        if any(effect.name == "sensor_frozen" for effect in changed):
            begun = self._changed(reads.times[:1], raw[:1], changed)
            raw[0] += self._known(reads, raw[0])
            raw = self._changed(reads.times, raw, changed)
            raw[:1] = begun
        else:
            raw = self._changed(reads.times, raw, changed)
        return raw if self.singles else self.sensors.virtual(raw)

    def _changed(
        self, times: np.ndarray, raw: np.ndarray, effects: Sequence[SensorEffect]
    ) -> np.ndarray:
        """Draws of readings, ``(T, D, S)``, with effects on readings themselves."""
        names, count = self.sensors.names, len(times)
        on, rng = np.ones(count, dtype=bool), np.random.default_rng(0)
        for effect in effects:
            if effect.name == "sensor_swapped":  # finds the twin by its place
                parts = [
                    effect.apply(times, raw[:, k], names, on, rng)
                    for k in range(self.draws)
                ]
                raw = np.stack(parts, axis=1)
            else:  # all draws as sensors side by side
                flat = raw.reshape(count, -1)
                made = effect.apply(times, flat, names * self.draws, on, rng)
                raw = made.reshape(raw.shape)
        return raw

    def _known(self, reads: Reads, drawn: np.ndarray) -> np.ndarray:
        """From drawn first readings to the recorded ones, ``(D, S)``."""
        if self.singles:
            return reads.first - drawn
        lacks = reads.first - self.sensors.virtual(drawn).mean(axis=0)
        left = np.array(["left" in name for name in self.sensors.names])
        return np.broadcast_to(np.where(left, lacks[0], lacks[1]), drawn.shape)

    def _raw(self, reads: Reads, effects: Sequence[Effect]) -> np.ndarray:
        """Draws before anything changes the readings themselves."""
        optics = [item for item in effects if isinstance(item, OpticsEffect)]
        if optics:
            return self._drawn(reads, optics)
        key = reads.poses.tobytes()
        if key not in self._plain:
            self._plain[key] = self._drawn(reads, ())
        return self._plain[key].copy()

    def _drawn(self, reads: Reads, optics: Sequence[OpticsEffect]) -> np.ndarray:
        law: dict = dict(self._law)
        for effect in optics:
            law = effect.change(law, self.sensors.names)
        light = self._light(law, reads, reads.poses)
        shape = (len(light), self.draws, light.shape[1])
        drawn = _noise(*shape)
        noise = tuple(part.reshape(-1, shape[2]) for part in drawn[:2])
        moved = light[:, None] * (1 + self.unsure(reads)[:, None] * drawn[2])
        read = light_law.counts(law, moved.reshape(-1, shape[2]), noise)
        return read.reshape(shape)

    def _light(self, law: Law, reads: Reads, poses: np.ndarray) -> np.ndarray:
        return light_law.irradiance(
            law, poses, reads.moments, sight=self.sensors.sight, screen=self.screen
        )


_KEPT: dict[tuple[int, int, int], np.ndarray] = {}


def _noise(count: int, draws: int, sensors: int) -> np.ndarray:
    """Standard normal numbers, of each reading one from every stratum; kept."""
    key = (count, draws, sensors)
    if key not in _KEPT:
        levels = norm.ppf((np.arange(draws) + 0.5) / draws)
        levels /= levels.std()
        rng = seeding.generator(0, "gap", "light", count)
        order = rng.random((4, count, draws, sensors)).argsort(axis=2)
        _KEPT[key] = levels[order]
    return _KEPT[key]


def extra(count: int, draws: int, channels: int) -> np.ndarray:
    """Further noise of each reading and draw, ``(T, D, R)``.

    Args:
        count: T, number of readings.
        draws: D, number of draws.
        channels: R, number of sensors.
    """
    return _noise(count, draws, channels)[3]


def _clipped(
    mean: np.ndarray, spread: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of normal numbers that are clipped."""
    a, b = (low - mean) / spread, (high - mean) / spread
    below, above = norm.cdf(a), norm.sf(b)
    inside = 1 - below - above
    da, db = norm.pdf(a), norm.pdf(b)
    first = mean * inside + spread * (da - db) + low * below + high * above
    square = (mean**2 + spread**2) * inside
    square += spread * ((mean + low) * da - (mean + high) * db)
    square += low**2 * below + high**2 * above
    return first, np.maximum(square - first**2, 0.0)
