"""A statistical model of the gap that knows no effects, beside the explanations.

A regression on the motion and on what else an effect may go with (the heading, the
place) predicts trials that it has not seen. An explanation that is right makes what is
left simpler; one that imitates something else makes it harder to predict than the gap
was, or it is the mean of what goes with the heading or the place, and leaves much that
these predict. Kennedy and O'Hagan (2001, section 4) call what such a regression
describes the discrepancy of a model.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.rest import Floor

RIDGE = 1.0  # precision of a standardized regressor's weight, in units of the floor
FEWEST = 4  # trials, each predicted from the others
BETTER = 0.75  # of what explanations leave: something else explains it better
SMALL = 0.5  # of the floor's variance: less is not worth another explanation
MUCH = 0.1  # of the gap: what explanations leave where they are the mean of something
WELL = 0.4  # of that: what goes with a pattern leaves so little
MOTION = "the motion"


def imitated(
    problem: Problem,
    gap: np.ndarray,
    rest: np.ndarray,
    known: Floor,
    inside: np.ndarray,
) -> str:
    """With what a gap goes whose explanations only imitate its cause; "" = they do not,
    or nobody can tell.

    Args:
        problem: the recording.
        gap: residuals of the nominal model, ``(N, C)``.
        rest: what the explanations leave, ``(N, C)``.
        known: the floor.
        inside: which residuals count, ``(N, C)``.
    """
    tried = Regression(problem, known, inside)
    if not tried.patterns or np.count_nonzero(tried.count) < FEWEST:
        return ""
    goes, other = tried.best(gap)
    plain = tried.squares(rest / known.sd)
    ours = min(plain, tried.best(rest)[1], key=tried.total)
    if tried.beats(other, ours, BETTER):
        return goes
    much = tried.total(plain) > MUCH * tried.total(tried.squares(gap / known.sd))
    mean = goes != MOTION and much and tried.beats(other, plain, WELL)
    return goes if mean else ""


@dataclass(frozen=True, eq=False)
class Regression:
    """Linear regressions of residuals, each trial predicted from the others.

    Attributes:
        problem: the recording.
        known: the floor.
        inside: which residuals count, ``(N, C)``.
    """

    problem: Problem
    known: Floor
    inside: np.ndarray

    @cached_property
    def count(self) -> np.ndarray:
        """How many residuals of each trial count, ``(T,)``."""
        return self._sums(self.inside)

    @cached_property
    def patterns(self) -> Mapping[str, np.ndarray]:
        """What effects may go with, ``(N, K)`` by name."""
        pairs = zip(self.problem.trials, self.problem.windows, strict=True)
        every = [self.problem.model.patterns(*pair) for pair in pairs]
        return {name: np.concatenate([row[name] for row in every]) for name in every[0]}

    def best(self, left: np.ndarray) -> tuple[str, np.ndarray]:
        """With what residuals ``(N, C)`` go best, in words, and the mean squares of
        trials that are predicted by it, ``(T,)``: the motion, or a pattern too."""
        made = np.nan_to_num(self.problem.recorded - left)
        span = np.concatenate([w.durations for w in self.problem.windows])[:, None]
        base = np.hstack([made, np.abs(made), made**2, span])
        tried = {MOTION: base}
        for name, pattern in self.patterns.items():
            told = np.hstack([made, span])
            both = (told[:, :, None] * pattern[:, None, :]).reshape(len(span), -1)
            tried[name] = np.hstack([base, both])
        found = {name: self._errors(left, parts) for name, parts in tried.items()}
        name = min(found, key=lambda n: self.total(found[n]))
        return name, found[name]

    def beats(self, other: np.ndarray, ours: np.ndarray, share: float) -> bool:
        """Whether one prediction is clearly better than another, in most trials.

        Args:
            other: its mean square in each trial, ``(T,)``.
            ours: that of the other, ``(T,)``; little beyond the floor is not worth it.
            share: of that which is clearly less.
        """
        told = self.count > 0
        mostly = np.log(ours[told] / other[told]).mean() > 0
        large = self.total(ours) > SMALL
        return bool(large and mostly and self.total(other) < share * self.total(ours))

    def _errors(self, left: np.ndarray, parts: np.ndarray) -> np.ndarray:
        """Mean square of each trial, predicted from the others by regressors
        ``(N, K)``; ``(T,)``."""
        units = np.where(self.inside, np.nan_to_num(left / self.known.sd), 0.0)
        scale = np.maximum(parts.std(axis=0), 1e-12)
        trials = [self.problem.trial == n for n in range(len(self.count))]
        for channel, seen in enumerate(self.inside.T):
            sd = self.known.sd[:, channel, None]
            rows = np.where(seen[:, None], parts / scale / (sd / np.median(sd)), 0.0)
            told = units[:, channel].copy()
            normal = np.stack([rows[of].T @ rows[of] for of in trials])
            right = np.stack([rows[of].T @ told[of] for of in trials])
            prior = RIDGE * np.eye(parts.shape[1])
            for n, of in enumerate(trials):
                others = prior + normal.sum(axis=0) - normal[n]
                weights = np.linalg.solve(others, right.sum(axis=0) - right[n])
                units[of, channel] -= rows[of] @ weights
        return self.squares(units)

    def squares(self, units: np.ndarray) -> np.ndarray:
        """Mean square of each trial's residuals that count, ``(T,)``."""
        square = np.where(self.inside, np.nan_to_num(units) ** 2, 0.0)
        return self._sums(square) / np.maximum(self.count, 1)

    def total(self, squares: np.ndarray) -> float:
        """Excess over the floor, per residual, of mean squares of trials ``(T,)``."""
        return float(self.count @ squares / max(self.count.sum(), 1) - 1.0)

    def _sums(self, values: np.ndarray) -> np.ndarray:
        count = len(self.problem.trials)
        return np.bincount(self.problem.trial, values.sum(axis=1), minlength=count)
