"""What recordings without a change tell of a nominal model that is a little wrong.

How far a nominal model is off in the directions that are known to be uncertain
(`Candidate.slack`) is a Gaussian guess. Recordings of the same robot before anything
was changed turn it into a posterior: its mean is taken off new recordings, its
covariance takes the guess's place (a discrepancy learnt from no-change data, after
Kennedy and O'Hagan 2001).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bns.gap.core.problem import Problem
from bns.gap.core.whitening import weights
from bns.gap.models.base import GapModel
from bns.gap.records import Candidate
from bns.worlds.trial import Trial


@dataclass(frozen=True, eq=False)
class Reference:
    """How the nominal model is off, in units of each candidate's slack.

    Attributes:
        candidates: the K uncertain directions.
        mean: ``(K,)``.
        factor: rows whose combinations are what remains uncertain, ``(K, K)``; their
            product ``factor.T @ factor`` is the covariance.
    """

    candidates: tuple[Candidate, ...]
    mean: np.ndarray
    factor: np.ndarray

    @classmethod
    def of(
        cls,
        trials: Sequence[Trial],
        model: GapModel,
        candidates: Sequence[Candidate],
    ) -> "Reference":
        """From recordings in which nothing was changed.

        Args:
            trials: checked recordings.
            model: nominal model.
            candidates: those with slack count.
        """
        uncertain = tuple(item for item in candidates if item.slack > 0)
        problem = Problem.of(trials, model)
        slopes = problem.signatures(_steps(uncertain))
        weight = weights(problem.rest)
        normal = np.eye(len(uncertain)) + (slopes * weight**2) @ slopes.T
        mean = np.linalg.solve(normal, slopes @ (problem.rest * weight**2))
        factor = np.linalg.inv(np.linalg.cholesky(normal))
        return cls(uncertain, mean, factor)

    def problem(self, trials: Sequence[Trial], model: GapModel) -> Problem:
        """A new recording, the nominal model put right as far as it is known."""
        plain = Problem.of(trials, model)
        sets = _steps(self.candidates)
        moved = model.simulate(plain.trials, sets)
        recorded = []
        for number, trial in enumerate(plain.trials):
            seen = np.stack([paths[number] for paths in moved])
            change = model.compare(trial, seen, plain.windows[number])
            change = change - plain.nominal[number]
            shift = np.tensordot(self.mean, change, axes=1)
            recorded.append(plain.recorded[number] - shift)
        directions = self.factor @ plain.signatures(sets)
        return Problem(
            model,
            plain.trials,
            plain.windows,
            tuple(recorded),
            plain.nominal,
            plain.floor,
            plain.whiten.uncertain(directions),
        )


def _steps(candidates: Sequence[Candidate]) -> list[list]:
    return [[item.make(item.nominal + item.slack)] for item in candidates]
