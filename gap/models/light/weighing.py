"""Explanations of readings weighed by the likelihood of every reading.

The search compares departures that are limited, in units of the nominal noise, and
beside each its size whatever its sign: quick, and a few wild readings do not decide.
But the two are one reading, which so counts twice, and an effect changes the noise as
well. The few explanations that come near are therefore weighed again: each reading has
the mean and the spread that it would have with the effect, and what sensors of one
kind may differ by is marginalised over.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.gap.core.null import LARGEST
from bns.gap.core.problem import Problem
from bns.gap.core.support import Term
from bns.gap.core.whitening import loss
from bns.gap.models.light.model import FAR, SightModel, stretched
from bns.worlds.effects.base import Effect

DRAWS = 48  # of each reading's noise
LEAST = 0.15  # spread of a reading in units of its nominal noise, at least
AROUND = 0.3  # share of a departure from nominal that a magnitude moves in a step
STEPS, ENOUGH = 6, 0.05  # of a fit at most; improvement below which it ends
FINE, SHARES = 0.02, (1.0, 0.3, 0.1)  # for slopes; of a step, where a whole one fails


@dataclass(frozen=True, eq=False)
class Weight:
    """How well an explanation goes with the readings.

    Attributes:
        terms: with the magnitudes that go best.
        deviance: minus twice the log likelihood, up to a constant.
        rest: what is left of each reading, in units of its spread, ``(N,)``.
    """

    terms: tuple[Term, ...]
    deviance: float
    rest: np.ndarray

    @property
    def scatter(self) -> float:
        """Mean square of the rest, about 1."""
        return float(np.minimum(self.rest**2, LARGEST).mean())


class Readings:
    """The readings of a recording, for explanations to be weighed by.

    Args:
        problem: of a `SightModel`.
        truth: None = the recorded readings, else those that this effect gives on
            average over recordings.
    """

    def __init__(self, problem: Problem, truth: Effect | None = None):
        if not isinstance(problem.model, SightModel):
            raise TypeError("Readings are those of a SightModel.")
        self.problem, self.model = problem, problem.model
        self._finer = problem.model.finer(DRAWS)
        self._uncertain = [item for item in self.model.candidates() if item.slack > 0]
        if truth:
            self._read, spread = self._expected(self._finer, [truth])
            self._varied = spread**2 + LEAST**2
            return
        names, self._varied = len(self.model.names), 0.0
        seen = [features[:, :names].ravel() for features in problem.recorded]
        self._read = stretched(np.concatenate(seen))

    def weigh(self, terms: Sequence[Term]) -> Weight:
        """An explanation at its best magnitudes near those given."""
        unsure = self._unsure([term.effect() for term in terms])
        size = _sizes(terms)
        now = self._weight(tuple(terms), unsure)
        for _ in range(STEPS):
            new = self._step(now, size, unsure)
            if new.deviance > now.deviance - ENOUGH:
                return now if now.deviance <= new.deviance else new
            now = new
        return now

    def _step(self, now: Weight, size: np.ndarray, unsure: np.ndarray) -> Weight:
        """A step of Gauss and Newton, shorter ones if it does not help."""
        start, free = _numbers(now.terms), np.flatnonzero(size)
        if not len(free):
            return now
        moves = np.diag(FINE * size)[free]
        beside = [self._weight(_moved(now.terms, start + m), unsure) for m in moves]
        slopes = np.array([(new.rest - now.rest) / FINE for new in beside])
        steps = np.linalg.lstsq(slopes.T, -now.rest, rcond=1e-6)[0]
        way = np.zeros_like(start)
        way[free] = np.clip(steps, -1, 1) * size[free]
        for share in SHARES:
            new = self._weight(_moved(now.terms, start + share * way), unsure)
            if new.deviance < now.deviance:
                return new
        return now

    def _weight(self, terms: tuple[Term, ...], unsure: np.ndarray) -> Weight:
        mean, spread = self._expected(self._finer, [term.effect() for term in terms])
        spread = np.hypot(spread, LEAST)
        basis, size, _ = np.linalg.svd(unsure / spread[:, None], full_matrices=False)
        rest = (self._read - mean) / spread
        rest = rest - basis @ ((1 - 1 / np.sqrt(1 + size**2)) * (basis.T @ rest))
        volume = 2 * np.log(spread).sum() + np.log1p(size**2).sum()
        volume += (self._varied / spread**2).sum()
        return Weight(terms, float(loss(rest) + volume), rest)

    def _unsure(self, effects: Sequence[Effect]) -> np.ndarray:
        """What sensors that differ by one sd would read otherwise, ``(N, k)``."""
        base, _ = self._expected(self.model, effects)
        ends = [
            self._expected(self.model, [item.make(item.nominal + way), *effects])[0]
            for item in self._uncertain
            for way in (FAR * item.slack, -FAR * item.slack)
        ]
        return (np.array(ends) - base).T / (FAR * np.sqrt(2))

    def _expected(
        self, model: SightModel, effects: Sequence[Effect]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and spread of each departure, ``(N,)``."""
        drawn = [
            model.departures(trial, effects)[windows.last]
            for trial, windows in zip(
                self.problem.trials, self.problem.windows, strict=True
            )
        ]
        mean = np.concatenate([part.mean(axis=1).ravel() for part in drawn])
        return mean, np.concatenate([part.std(axis=1).ravel() for part in drawn])


def apart(problem: Problem, term: Term, starts: Sequence[Term]) -> dict[str, float]:
    """How far candidates at their best are from an effect.

    Args:
        problem: a recording; its poses and its noise count.
        term: the effect.
        starts: the candidates, near what the effect does.

    Returns:
        by name in standard deviations: the root of what the log likelihood ratio of
        the effect over the candidate is on average, doubled.
    """
    readings = Readings(problem, term.effect())
    least = readings.weigh([term]).deviance
    found: dict[str, float] = {}
    for start in starts:
        far = max(readings.weigh([start]).deviance - least, 0.0) ** 0.5
        name = start.candidate.name
        found[name] = min(far, found.get(name, far))
    return found


def _numbers(terms: Sequence[Term]) -> np.ndarray:
    return np.array([n for term in terms for n in (term.magnitude, *term.extras)])


def _sizes(terms: Sequence[Term]) -> np.ndarray:
    """How far each number may move; 0 for whole ones."""
    return np.array(
        [
            size
            for term in terms
            for size in (
                0.0
                if term.candidate.whole
                else AROUND * (term.magnitude - term.candidate.nominal),
                *(AROUND for _ in term.extras),
            )
        ]
    )


def _moved(terms: Sequence[Term], numbers: np.ndarray) -> tuple[Term, ...]:
    made, at = [], 0
    for term in terms:
        item, extras = term.candidate, numbers[at + 1 : at + 1 + len(term.extras)]
        magnitude = float(np.clip(numbers[at], item.low, item.high))
        given = tuple(map(float, extras))
        made.append(replace(term, magnitude=magnitude, extras=given))
        at += 1 + len(extras)
    return tuple(made)
