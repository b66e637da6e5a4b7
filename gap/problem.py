"""A recording, a model and the floor, made ready: `Problem`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.gap import floor as floors
from bns.gap.floor import Floor
from bns.gap.model import GapModel, Windows
from bns.gap.records import Candidate
from bns.gap.whiten import Whitener
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial


@dataclass(frozen=True, eq=False)
class Problem:
    """What every later stage works on.

    Attributes:
        model: nominal model.
        trials: checked recording.
        windows: of each trial.
        recorded: features of each trial, ``(W, C)``.
        nominal: predicted features of each, likewise.
        floor: see `floor`.
        whiten: see `whiten`.
    """

    model: GapModel
    trials: tuple[Trial, ...]
    windows: tuple[Windows, ...]
    recorded: tuple[np.ndarray, ...]
    nominal: tuple[np.ndarray, ...]
    floor: Floor
    whiten: Whitener

    @classmethod
    def of(
        cls,
        trials: Sequence[Trial],
        model: GapModel,
        *,
        candidates: Sequence[Candidate] = (),
        floor: Floor | None = None,
    ) -> "Problem":
        """Simulate the nominal model and set up the whitening.

        Args:
            trials: checked recording.
            model: nominal model.
            candidates: their slack says how uncertain the nominal model is.
            floor: None = estimated.
        """
        trials = tuple(trials)
        (predicted,) = model.simulate(trials, [()])
        windows = tuple(model.windows(trial) for trial in trials)
        floor = floor or floors.estimate(model, trials, predicted)
        made = cls(
            model,
            trials,
            windows,
            tuple(map(model.compare, trials, (t.observed for t in trials), windows)),
            tuple(map(model.compare, trials, predicted, windows)),
            floor,
            Whitener.of(model, trials, windows, floor),
        )
        uncertain = [item for item in candidates if item.slack > 0]
        if not uncertain:
            return made
        sets = [[item.make(item.nominal + item.slack)] for item in uncertain]
        return replace(made, whiten=made.whiten.uncertain(made.signatures(sets)))

    @property
    def rest(self) -> np.ndarray:
        """Whitened recorded minus nominal motion, ``(N,)``."""
        return self._whitened(self.recorded, self.nominal)

    def signatures(self, effects: Sequence[Sequence[Effect]]) -> np.ndarray:
        """Whitened change of the motion by sets of effects, ``(E, N)``.

        NaN in a row whose simulation diverged.
        """
        rows = [
            self._whitened(features, self.nominal)
            for features in self._features(effects)
        ]
        return np.array(rows)

    def rests(self, effects: Sequence[Sequence[Effect]]) -> np.ndarray:
        """Whitened recorded minus predicted motion, ``(E, N)``."""
        return self.rest - self.signatures(effects)

    def _features(self, effects: Sequence[Sequence[Effect]]) -> list[list[np.ndarray]]:
        return [
            [
                self.model.compare(trial, seen, windows)
                for trial, seen, windows in zip(
                    self.trials, predicted, self.windows, strict=True
                )
            ]
            for predicted in self.model.simulate(self.trials, effects)
        ]

    def _whitened(self, left: Sequence, right: Sequence) -> np.ndarray:
        return self.whiten([a - b for a, b in zip(left, right, strict=True)])
