"""What pictures of a diagnosis show: recorded, nominal and corrected motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bns.gap import store
from bns.gap.models.base import GapModel
from bns.gap.recordings import check
from bns.gap.records import Diagnosis, Residuals
from bns.gap.where import horizons
from bns.gap.where.compared import Compared, terms
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

MOST = 6
"""features that a figure has room for"""


@dataclass(frozen=True, eq=False)
class View:
    """A recording beside its predictions.

    Attributes:
        problem: the recording beside the nominal model.
        effects: of the corrected model; empty where nothing explains the gap.
        nominal, corrected: predicted samples of each trial, ``(T, n_channels)``.
        left: features of recorded minus corrected motion of each trial, ``(W, C)``.
        shown: number of the trial that is drawn: the one with the largest gap.
        after: residuals of the corrected model by horizon.
    """

    problem: Compared
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
        return self.problem.scatter[trial]

    def largest(self, most: int = MOST) -> list[int]:
        """The features with the largest gaps, by the floor; all where there are few.

        Returns:
            Their numbers, in order.
        """
        sizes = [gap**2 for gap in self.problem.gap]
        size = np.nanmean(np.concatenate(sizes), axis=0)
        return sorted(np.argsort(-size, kind="stable")[:most].tolist())

    def energy(self, trial: int) -> np.ndarray:
        """Loss of the nominal model in each window of a trial; 1 = the floor."""
        return terms(self.problem.gap[trial]).mean(axis=1)


def view(found: Diagnosis, trials: Sequence[Trial], model: GapModel) -> View:
    """Simulate what a diagnosis found.

    Args:
        found: the diagnosis.
        trials: the recording it was made of.
        model: its nominal model.
    """
    usable, _ = check.check(trials, model)
    effects = tuple(store.parse(text, model) for text in corrections(found))
    problem = Compared.diagnosed(found, usable, model)
    nominal, corrected = model.simulate(usable, [(), effects])
    left = tuple(
        recorded - model.compare(trial, made, windows)
        for recorded, trial, made, windows in zip(
            problem.recorded, usable, corrected, problem.windows, strict=True
        )
    )
    losses = [terms(gap).mean() for gap in problem.gap]
    return View(
        problem,
        effects,
        tuple(nominal),
        tuple(corrected),
        left,
        int(np.argmax(losses)),
        horizons.residuals(problem, effects, seed=found.seed),
    )


def corrections(found: Diagnosis) -> tuple[str, ...]:
    """Effects of the model that is drawn as corrected.

    Where nothing of the library explains the gap it is the best attempt.
    """
    if found.verdict.kind == "none of the library":
        return tuple(found.signatures.get("best", ()))
    return tuple(found.best.effects)
