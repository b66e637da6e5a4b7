"""Explanations by themselves, each fitted to the simulation: through a tangent at the
nominal a strong one looks like several, or like another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bns.gap.decomposition import fit, levels
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.problem import Problem

WIDE = 3  # numbers of an explanation from which its tangent tells little of it
TURNS = 6  # of the fit of each


@dataclass(frozen=True, eq=False)
class Single:
    """An explanation that was fitted by itself.

    Attributes:
        name: of the explanation.
        values: of all rows, ``(R,)``.
        height: loss that it leaves, over what counts as one residual, and the squared
            departures of the nuisances: twice the nats.
    """

    name: str
    values: np.ndarray
    height: float


@dataclass(frozen=True, eq=False)
class Singles:
    """Fits of the explanations that promise most by themselves.

    Attributes:
        problem: the recording.
        start: the nominal model.
    """

    problem: Problem
    start: Point

    @cached_property
    def fitted(self) -> tuple[Single, ...]:
        """The fit of each explanation that is tried, the best first."""
        problem, start = self.problem, self.start
        only = self._looked_at
        best: dict[str, Single] = {}
        for name, values in self._starts(only):
            wanted = {name} | fit.nuisances(problem)
            values, rest = fit.newton(
                problem, values, wanted, start.noise, turns=TURNS, only=only
            )
            height = start.noise.loss(rest) / start.noise.lam + _prior(problem, values)
            if name not in best or height < best[name].height:
                best[name] = Single(name, values, height)
        return tuple(sorted(best.values(), key=lambda one: (one.height, one.name)))

    @property
    def _looked_at(self) -> list[int] | None:
        """Trials that these are fitted to; None = all."""
        few = self.problem.sample(fit.ROUGH)
        whole = self.problem.model.singly or len(few) == len(self.problem.trials)
        return None if whole else few

    def _starts(self, only: list[int] | None) -> Sequence[tuple[str, np.ndarray]]:
        """Values to start from: by the tangent, and by levels and departures."""
        linear, most = self.start.linear, self.problem.model.starts
        order = sorted(linear.free, key=lambda name: linear.cost({name}))
        many = [name for name in order if wide(linear.terms, name)]
        order = [*dict.fromkeys((*order[:most], *many[: most // 2]))]
        tangent = [
            (name, fit.placed(self.problem, linear, {name}, self.start.values))
            for name in order
        ]
        return tangent + levels.screened(self.problem, self.start, most, only)


def wide(terms: Mapping[str, tuple[int, ...]], name: str) -> bool:
    """Whether an explanation has so many numbers that it imitates much."""
    return len(terms[name]) >= WIDE


def _prior(problem: Problem, values: np.ndarray) -> float:
    """What nuisances cost, in squared deviations."""
    rows = [k for name in fit.nuisances(problem) for k in problem.terms[name]]
    return float((((values - problem.nominal) / problem.sd)[rows] ** 2).sum())
