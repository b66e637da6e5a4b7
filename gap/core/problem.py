"""A recording, a model and the floor, made ready: `Problem`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bns.gap.core import floor as floors
from bns.gap.core.floor import Floor
from bns.gap.core.whitening import Whitener
from bns.gap.models.base import GapModel, Windows
from bns.gap.records import Candidate
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
            floor: None = the model's own, if it knows it, else estimated.
        """
        trials = tuple(narrowed(trial, model) for trial in trials)
        (predicted,) = model.simulate(trials, [()])
        windows = tuple(model.windows(trial) for trial in trials)
        floor = floor or getattr(model, "floor", None)
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
        unsure = getattr(model, "unsure", _linear)
        return replace(made, whiten=unsure(made, uncertain))

    @cached_property
    def rest(self) -> np.ndarray:
        """Whitened recorded minus nominal motion, ``(N,)``."""
        return self._whitened(self.recorded, self.nominal)

    @cached_property
    def sketched(self) -> tuple[np.ndarray, ...]:
        """Predicted features of each trial by the model's rougher simulation."""
        if not hasattr(self.model, "sketch"):
            return self.nominal
        (paths,) = self.model.sketch(self.trials, [()])
        return tuple(map(self.model.compare, self.trials, paths, self.windows))

    def signatures(
        self, effects: Sequence[Sequence[Effect]], *, rough: bool = False
    ) -> np.ndarray:
        """Whitened change of the motion by sets of effects, ``(E, N)``.

        Args:
            effects: sets of effects.
            rough: where the model has a quicker, rougher simulation (`sketch`), by it.

        Returns:
            NaN in a row whose simulation diverged.
        """
        simulate, base = self.model.simulate, self.nominal
        if rough and hasattr(self.model, "sketch"):
            simulate, base = self.model.sketch, self.sketched
        made = simulate(self.trials, effects)
        parts = []
        for number, (trial, windows, nominal) in enumerate(
            zip(self.trials, self.windows, base, strict=True)
        ):
            seen = np.stack([paths[number] for paths in made])
            parts.append(self.model.compare(trial, seen, windows) - nominal)
        return self.whiten.many(parts)

    def rests(self, effects: Sequence[Sequence[Effect]]) -> np.ndarray:
        """Whitened recorded minus predicted motion, ``(E, N)``."""
        return self.rest - self.signatures(effects)

    def _whitened(self, left: Sequence, right: Sequence) -> np.ndarray:
        return self.whiten([a - b for a, b in zip(left, right, strict=True)])


def _linear(problem: Problem, uncertain: Sequence[Candidate]) -> Whitener:
    """A whitener that knows how the nominal model may be off, in proportion to it.

    A model's own `unsure` does the same where proportion does not hold.
    """
    sets = [[item.make(item.nominal + item.slack)] for item in uncertain]
    return problem.whiten.uncertain(problem.signatures(sets, rough=True))


def narrowed(trial: Trial, model: GapModel) -> Trial:
    """A trial with the channels of the model alone, which come first."""
    count = len(model.channels)
    if len(trial.channels) == count:
        return trial
    return trial.replace(
        observed=trial.observed[:, :count], channels=trial.channels[:count]
    )
