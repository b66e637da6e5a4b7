"""A nominal model put right by recordings in which nothing was changed.

What departs there departs anyway: it is fitted as any gap is, its values become the
nominal ones, and how far they remain unsure takes the slack's place (a discrepancy
learnt from no-change data, after Kennedy and O'Hagan 2001).
"""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bns.gap.decomposition import descent, fit, shares, starts
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row
from bns.gap.decomposition.singles import Singles
from bns.gap.models.base import GapModel, Windows
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial


class Corrected(GapModel):
    """A model some of whose rows are not where they were believed to be.

    Args:
        model: the nominal model.
        moved: departures of rows from their nominal values, by name.
        slack: how far each row remains unsure (standard deviation), by name.
    """

    def __init__(
        self, model: GapModel, moved: Mapping[str, float], slack: Mapping[str, float]
    ):
        self.model, self.moved, self.slack = model, dict(moved), dict(slack)
        self._nominal: dict[str, float] = {}
        for name in GapModel.__annotations__:
            setattr(self, name, getattr(model, name))

    @classmethod
    def of(cls, trials: Sequence[Trial], model: GapModel) -> "Corrected":
        """From checked recordings in which nothing was changed."""
        problem = Problem.of(trials, model)
        tried = Singles(problem, descent.nothing(problem))
        problem, point = descent.beside(problem, starts.explained(tried))
        support = shares.guarded(problem, point)
        values = fit.placed(problem, point.linear, support, point.values)
        linear = point.linear
        found = linear.solve(support)
        spread = np.sqrt(np.diagonal(linear.covariance(support)))
        moved, slack = {}, {}
        for at, number in enumerate(linear.columns):
            row = problem.rows[number]
            inside = row.term in support
            off = values[number] - row.nominal if inside else found[at] * row.sd
            if row.nuisance or not off:
                continue
            moved[row.name] = float(off)
            slack[row.name] = float(max(spread[at] * row.sd, 1e-3 * row.sd))
        return cls(model, moved, slack)

    @property
    def least(self) -> np.ndarray:
        """See `GapModel.least`."""
        return self.model.least

    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """The model's rows, as sure as the recordings without a change make them."""
        found = self.model.rows(trials)
        self._nominal = {row.name: row.nominal for row in found}
        return tuple(
            replace(row, slack=self.slack[row.name]) if row.name in self.slack else row
            for row in found
        )

    def stepped(self, trials: Sequence[Trial], rows: Sequence[Row]) -> tuple[Row, ...]:
        """See `GapModel.stepped`: by the model as it was."""
        return self.model.stepped(trials, rows)

    def grid(self, trial: Trial) -> float:
        """See `GapModel.grid`."""
        return self.model.grid(trial)

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: by the model as it was."""
        return self.model.simulate(trials, effects)

    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """See `GapModel.paths`: departures on top of those that are there anyway."""
        changed = [[self._whole(values) for values in row] for row in sets]
        return self.model.paths(trials, changed, fine=fine)

    def _whole(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values of the model as it was, of those of this one."""
        known = {n: off for n, off in self.moved.items() if n in self._nominal}
        there = {n: values.get(n, self._nominal[n]) + off for n, off in known.items()}
        return {**values, **there}

    def beside(
        self, trials: Sequence[Trial], known: Sequence[Mapping[str, float]]
    ) -> tuple[GapModel, Sequence[Trial]]:
        """See `GapModel.beside`."""
        model, begun = self.model.beside(trials, [self._whole(row) for row in known])
        if model is self.model:
            return self, begun
        made = copy.copy(self)
        made.model = model
        return made, begun

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """See `GapModel.compare`."""
        return self.model.compare(trial, observed, windows)

    def windows(self, trial: Trial) -> Windows:
        """See `GapModel.windows`."""
        return self.model.windows(trial)

    def joint_windows(self, trial: Trial) -> Windows:
        """See `GapModel.joint_windows`."""
        return self.model.joint_windows(trial)

    def effect(self, term: str, values: Mapping[str, float]) -> Effect | None:
        """See `GapModel.effect`."""
        return self.model.effect(term, values)

    def covered(self, term: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """See `GapModel.covered`."""
        return self.model.covered(term, values)

    def motion(self, features: np.ndarray) -> np.ndarray:
        """See `GapModel.motion`."""
        return self.model.motion(features)

    def travelled(self, features: np.ndarray) -> np.ndarray:
        """See `GapModel.travelled`."""
        return self.model.travelled(features)

    def patterns(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """See `GapModel.patterns`."""
        return self.model.patterns(trial, windows)

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """See `GapModel.regime`."""
        return self.model.regime(trial, windows)

    def blocks(self, trials: Sequence[Trial], windows: Sequence[Windows]) -> np.ndarray:
        """See `GapModel.blocks`."""
        return self.model.blocks(trials, windows)

    def begun(self, trial: Trial) -> Mapping[str, float]:
        """See `GapModel.begun`."""
        return self.model.begun(trial)

    def read_log(self, path: str, columns: str = "") -> list[Trial]:
        """See `GapModel.read_log`."""
        return self.model.read_log(path, columns)

    def excitations(
        self, *, seed: int = 0, told: Mapping[str, float] | None = None
    ) -> tuple[Any, ...]:
        """See `GapModel.excitations`."""
        return self.model.excitations(seed=seed, told=told)

    def parse(self, text: str) -> Effect:
        """See `GapModel.parse`."""
        return self.model.parse(text)

    def untried(self) -> tuple[str, ...]:
        """See `GapModel.untried`."""
        return self.model.untried()

    def unlisted(self) -> GapModel | None:
        """See `GapModel.unlisted`."""
        model = self.model.unlisted()
        return model and Corrected(model, self.moved, self.slack)

    def at_rest(self, trial: Trial, predicted: np.ndarray) -> frozenset[str]:
        """See `GapModel.at_rest`."""
        return self.model.at_rest(trial, predicted)
