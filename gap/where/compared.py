"""A recording beside what a nominal model predicts, in units of its scatter."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bns.gap.models.base import GapModel, Windows
from bns.gap.recordings.trial_selection import narrowed
from bns.gap.records import Diagnosis
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

CLIP = 3.0  # standard deviations beyond which residuals count linearly
DRAWS = 16  # of measurement noise, for what it does to features


@dataclass(frozen=True, eq=False)
class Compared:
    """Windows that tile a recording, recorded and predicted.

    Attributes:
        model: nominal model.
        trials: checked recording, with the model's channels alone.
        windows: of each trial.
        recorded, nominal: features of each trial, ``(W, C)``.
        sigma: what measuring scatters, of each observed channel, ``(n_channels,)``.
        process: what the motion scatters by itself in a second, by feature, ``(C,)``.
    """

    model: GapModel
    trials: tuple[Trial, ...]
    windows: tuple[Windows, ...]
    recorded: tuple[np.ndarray, ...]
    nominal: tuple[np.ndarray, ...]
    sigma: np.ndarray
    process: np.ndarray

    @classmethod
    def of(
        cls,
        trials: Sequence[Trial],
        model: GapModel,
        sigma: Sequence[float] | np.ndarray,
    ) -> "Compared":
        """Simulate the nominal model.

        Args:
            trials: checked recording.
            model: nominal model.
            sigma: what measuring scatters, by observed channel, ``(C,)`` in their
                units; 0 = as the model says.
        """
        known = np.nan_to_num(np.asarray(sigma, dtype=float))
        trials = tuple(narrowed(trial, model.channels) for trial in trials)
        (predicted,) = model.simulate(trials, [()])
        windows = tuple(model.windows(trial) for trial in trials)
        return cls(
            model,
            trials,
            windows,
            tuple(map(model.compare, trials, (t.observed for t in trials), windows)),
            tuple(map(model.compare, trials, predicted, windows)),
            np.where(known > 0, known, model.resolution),
            np.asarray(model.process, dtype=float),
        )

    @classmethod
    def diagnosed(
        cls, found: Diagnosis, trials: Sequence[Trial], model: GapModel
    ) -> "Compared":
        """With the scatter that a diagnosis measured.

        Args:
            found: the diagnosis.
            trials: checked recording.
            model: nominal model.
        """
        sigma = np.array(found.floor["sigma"][: len(model.channels)], dtype=float)
        process = np.asarray(found.floor.get("process", model.process), dtype=float)
        return replace(cls.of(trials, model, sigma), process=process)

    def noise(self, trial: int, windows: Windows) -> np.ndarray:
        """Mean square that scatter alone gives in windows of a trial, ``(W, C)``."""
        known = self.trials[trial]
        seen = np.nan_to_num(known.observed)
        rng = np.random.default_rng(0)
        drawn = seen + self.sigma * rng.standard_normal((DRAWS, *seen.shape))
        change = self.model.compare(known, drawn, windows)
        change = change - self.model.compare(known, seen, windows)
        measured = (change**2).mean(axis=(0, 1))
        return measured + np.outer(windows.durations, self.process**2)

    @cached_property
    def scatter(self) -> tuple[np.ndarray, ...]:
        """Standard deviation of each feature of each trial, ``(W, C)``."""
        return tuple(
            np.sqrt(self.noise(number, windows))
            for number, windows in enumerate(self.windows)
        )

    @cached_property
    def gap(self) -> tuple[np.ndarray, ...]:
        """Recorded minus nominal features of each trial, in deviations, ``(W, C)``."""
        return tuple(
            (seen - made) / sd
            for seen, made, sd in zip(
                self.recorded, self.nominal, self.scatter, strict=True
            )
        )

    def left(self, effects: Sequence[Effect]) -> tuple[np.ndarray, ...]:
        """The same with effects added to the nominal model, by trial ``(W, C)``."""
        (predicted,) = self.model.simulate(self.trials, [tuple(effects)])
        made = map(self.model.compare, self.trials, predicted, self.windows)
        return tuple(
            (seen - features) / sd
            for seen, features, sd in zip(
                self.recorded, made, self.scatter, strict=True
            )
        )


def terms(units: np.ndarray) -> np.ndarray:
    """What residuals in deviations ``(W, C)`` add to a loss, ``(W, C)``: their square,
    linear beyond `CLIP`; those not seen nothing."""
    size = np.abs(np.nan_to_num(units))
    return np.where(size <= CLIP, size**2, CLIP * (2 * size - CLIP))


def coarser(windows: Windows, length: float) -> Windows:
    """Windows of at least a length [s], made of whole given ones."""
    begins, closes, begin = [], [], 0
    ends = windows.times + windows.durations / 2
    starts = windows.times - windows.durations / 2
    for end in range(len(windows)):
        if ends[end] - starts[begin] >= 0.97 * length or (
            np.isinf(length) and end == len(windows) - 1
        ):
            begins.append(begin)
            closes.append(end)
            begin = end + 1
    first, last = np.array(begins, dtype=int), np.array(closes, dtype=int)
    span = ends[last] - starts[first]
    return Windows(
        windows.first[first], windows.last[last], starts[first] + span / 2, span
    )
