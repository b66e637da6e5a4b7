"""Effects with values, and what they leave of a recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from bns.gap.core.problem import Problem
from bns.gap.core.whitening import loss
from bns.gap.records import Candidate
from bns.worlds.effects.base import Effect

SHARE = (0.0, 0.0, 1.0, "1")
"""nominal, bounds and unit of a magnitude that is a share of the whole effect"""


@dataclass(frozen=True)
class Term:
    """A candidate with values: one of the effects of a fit."""

    candidate: Candidate
    branch: int
    magnitude: float
    extras: tuple[float, ...] = ()

    @classmethod
    def at(cls, candidate: Candidate, branch: int, magnitude: float) -> "Term":
        """With the extras of the branch.

        Args:
            candidate: the explanation.
            branch: index into its branches.
            magnitude: in its unit.
        """
        values = {**candidate.fixed, **candidate.branches[branch]}
        extras = tuple(float(values.get(name, 0.0)) for name in candidate.extras)
        return cls(candidate, branch, float(magnitude), extras)

    def effect(self) -> Effect:
        """As an effect of the library."""
        extras = dict(zip(self.candidate.extras, self.extras, strict=True))
        return self.candidate.make(self.magnitude, self.branch, extras)

    @property
    def at_bound(self) -> bool:
        """Whether the magnitude sits on a bound that is not the nominal.

        The whole of an effect whose magnitude is a share of it is no such bound.
        """
        item, near = self.candidate, 1e-6 * (self.candidate.high - self.candidate.low)
        if (item.nominal, item.low, item.high, item.unit) == SHARE:
            return False
        ends = [end for end in (item.low, item.high) if end != item.nominal]
        return any(abs(self.magnitude - end) <= near for end in ends)

    @property
    def believed(self) -> float:
        """Probability that a nominal model without any gap is off by so much.

        By the slack of the candidate; 0 where the model is exact there.
        """
        item = self.candidate
        if not item.slack:
            return 0.0
        return float(2 * norm.sf(abs(self.magnitude - item.nominal) / item.slack))


@dataclass(frozen=True, eq=False)
class Point:
    """A fit: terms, the whitened rest and its slopes.

    Attributes:
        terms: the effects.
        rest: whitened recorded minus predicted, ``(N,)``.
        loss: of the rest.
        slopes: change of the prediction by each magnitude, then each extra of the
            first term and so on, ``(p, N)``; empty until fitted.
    """

    terms: tuple[Term, ...]
    rest: np.ndarray
    loss: float
    slopes: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the candidates."""
        return tuple(term.candidate.name for term in self.terms)


def evaluate(
    problem: Problem, supports: Sequence[Sequence[Term]], *, rough: bool = False
) -> list[Point]:
    """The loss of supports as they are, in one batch of simulations.

    Args:
        problem: the recording.
        supports: terms of each.
        rough: by the quicker simulation, where the model has one.

    Returns:
        one point for each support, without slopes.
    """
    if not supports:
        return []
    effects = [[term.effect() for term in terms] for terms in supports]
    rests = problem.rest - problem.signatures(effects, rough=rough)
    return [
        Point(tuple(terms), rest, finite(loss(rest)), np.zeros((0, len(rest))))
        for terms, rest in zip(supports, rests, strict=True)
    ]


def finite(value: float) -> float:
    """A loss; infinite where the simulation diverged."""
    return float(value) if np.isfinite(value) else np.inf
