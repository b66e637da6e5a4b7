"""Explanations by themselves, each fitted to the simulation: through a tangent at the
nominal a strong one looks like several, or like another."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bns.gap.decomposition import fit, levels
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.refit import newton

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
        problem, only = self.problem, self._looked_at
        most = problem.model.starts
        screened = levels.screened(problem, self.start, most, only)
        return self._best((*self._tangent, *self._fits(screened)))

    def among(self, names: Collection[str]) -> tuple[Single, ...]:
        """The fits of some explanations, whatever others promise; the best first."""
        only, names = self._looked_at, frozenset(names)
        begun = levels.screened(self.problem, self.start, len(names), only, names)
        return self._best(self._fits(begun))

    @cached_property
    def by_tangent(self) -> tuple[Single, ...]:
        """Those of them that were found by the tangent at the nominal alone."""
        return self._best(self._tangent)

    @cached_property
    def _tangent(self) -> tuple[Single, ...]:
        linear, most = self.start.linear, self.problem.model.starts
        order = sorted(linear.free, key=lambda name: linear.cost({name}))
        many = [name for name in order if wide(linear.terms, name)]
        order = [*dict.fromkeys((*order[:most], *many[: most // 2]))]
        return self._fits(
            (name, fit.placed(self.problem, linear, {name}, self.start.values))
            for name in order
        )

    def _fits(self, starts: Iterable[tuple[str, np.ndarray]]) -> tuple[Single, ...]:
        """Fits from starts: names, and values of all rows ``(R,)``."""
        problem, known, only = self.problem, self.start.noise, self._looked_at
        made = []
        for name, begun in starts:
            wanted = {name} | fit.nuisances(problem)
            values, rest = newton(problem, begun, wanted, known, turns=TURNS, only=only)
            height = known.loss(rest) / known.lam + _prior(problem, values)
            made.append(Single(name, values, height))
        return tuple(made)

    @staticmethod
    def _best(fits: Iterable[Single]) -> tuple[Single, ...]:
        """The best fit of each explanation, the best first."""
        best: dict[str, Single] = {}
        for one in fits:
            if one.name not in best or one.height < best[one.name].height:
                best[one.name] = one
        return tuple(sorted(best.values(), key=lambda one: (one.height, one.name)))

    @property
    def _looked_at(self) -> list[int] | None:
        """Trials that these are fitted to; None = all."""
        few = self.problem.sample(fit.ROUGH)
        whole = self.problem.model.singly or len(few) == len(self.problem.trials)
        return None if whole else few


def wide(terms: Mapping[str, tuple[int, ...]], name: str) -> bool:
    """Whether an explanation has so many numbers that it imitates much."""
    return len(terms[name]) >= WIDE


def leading(
    terms: Mapping[str, tuple[int, ...]], singles: Sequence[Single]
) -> list[Single]:
    """The first of some single explanations, and the first one of few numbers."""
    narrow = [one for one in singles if not wide(terms, one.name)]
    return [*dict.fromkeys((*singles[:1], *narrow[:1]))]


def _prior(problem: Problem, values: np.ndarray) -> float:
    """What nuisances cost, in squared deviations."""
    rows = [k for name in fit.nuisances(problem) for k in problem.terms[name]]
    return float((((values - problem.nominal) / problem.sd)[rows] ** 2).sum())
