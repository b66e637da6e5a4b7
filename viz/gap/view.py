"""What pictures of a diagnosis show: recorded, nominal and corrected motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bns.gap import store
from bns.gap.core import residuals
from bns.gap.core.floor import derivative
from bns.gap.core.problem import Problem
from bns.gap.core.whitening import terms
from bns.gap.models.base import GapModel
from bns.gap.recordings import check
from bns.gap.records import Diagnosis, Residuals
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

MOST = 6
"""features that a figure has room for"""


@dataclass(frozen=True, eq=False)
class View:
    """A recording beside its predictions.

    Attributes:
        problem: the recording and the nominal model.
        effects: of the corrected model; empty where nothing explains the gap.
        nominal, corrected: predicted samples of each trial, ``(T, n_channels)``.
        left: features of recorded minus corrected motion of each trial, ``(W, C)``.
        shown: number of the trial that is drawn: the one with the largest gap.
        after: residuals of the corrected model by horizon.
    """

    problem: Problem
    effects: tuple[Effect, ...]
    nominal: tuple[np.ndarray, ...]
    corrected: tuple[np.ndarray, ...]
    left: tuple[np.ndarray, ...]
    shown: int
    after: Residuals

    @property
    def trials(self) -> tuple[Trial, ...]:
        """The trials that were used."""
        return self.problem.trials

    def gap(self, trial: int) -> np.ndarray:
        """Features of recorded minus nominal motion of a trial, ``(W, C)``."""
        return self.problem.recorded[trial] - self.problem.nominal[trial]

    def scatter(self, trial: int) -> np.ndarray:
        """Standard deviation of the floor in each window of a trial, ``(W, C)``."""
        floor, windows = self.problem.floor, self.problem.windows[trial]
        model = self.problem.model
        jacobian = derivative(model, self.trials[trial], windows) * floor.sigma
        own = (jacobian**2).sum(axis=(1, 2)).reshape(len(windows), -1)
        return np.sqrt(own + np.outer(windows.durations, floor.process**2))

    def largest(self, most: int = MOST) -> list[int]:
        """The features with the largest gaps, by the floor; all where there are few.

        Returns:
            Their numbers, in order.
        """
        sizes = [(self.gap(n) / self.scatter(n)) ** 2 for n in range(len(self.trials))]
        size = np.nanmean(np.concatenate(sizes), axis=0)
        return sorted(np.argsort(-size, kind="stable")[:most].tolist())

    def energy(self, trial: int) -> np.ndarray:
        """Loss of the nominal model in each window of a trial; 1 = the floor."""
        rows = self.problem.whiten.rows[trial]
        channels = len(self.problem.model.features)
        return terms(self.problem.rest[rows]).reshape(-1, channels).mean(axis=1)


def view(found: Diagnosis, trials: Sequence[Trial], model: GapModel) -> View:
    """Simulate what a diagnosis found.

    Args:
        found: the diagnosis.
        trials: the recording it was made of.
        model: its nominal model.
    """
    usable, _ = check.check(trials, model)
    effects = tuple(store.parse(text, model) for text in corrections(found))
    problem = Problem.of(usable, model, candidates=model.candidates())
    nominal, corrected = model.simulate(usable, [(), effects])
    left = tuple(
        recorded - model.compare(trial, made, windows)
        for recorded, trial, made, windows in zip(
            problem.recorded, usable, corrected, problem.windows, strict=True
        )
    )
    losses = [terms(problem.rest[rows]).mean() for rows in problem.whiten.rows]
    return View(
        problem,
        effects,
        tuple(nominal),
        tuple(corrected),
        left,
        int(np.argmax(losses)),
        residuals.residuals(problem, effects, seed=found.seed),
    )


def corrections(found: Diagnosis) -> tuple[str, ...]:
    """Effects of the model that is drawn as corrected.

    Where nothing of the library explains the gap it is the best attempt.
    """
    if found.verdict.kind == "none of the library":
        return tuple(found.signatures.get("best", ()))
    return tuple(found.best.effects)
