"""What is not known of the state in which each trial began, taken out of residuals.

A trial that is cut from a recording begins in motion, in a state that the data tell to
within their noise. An error there grows or dies with the motion, so that residuals of
one trial go together: their covariance is that of the measurement plus one direction
for each number of the state. Residuals are made independent again by shrinking what
lies in these directions (Woodbury's identity).
"""

from dataclasses import dataclass

import numpy as np

from bns.gap.decomposition.problem import Problem

FELT = 0.1  # deviations of a residual's noise: less is not felt


@dataclass(frozen=True, eq=False)
class Starts:
    """Directions of each trial's start.

    Attributes:
        sd: of the measurement by feature, ``(C,)``.
        parts: of each trial that has some: its windows, orthonormal directions
            ``(n * C, k)``, and what is left of a residual in each ``(k,)``.
        spread: standard deviation that starts give each feature, ``(N, C)``.
    """

    sd: np.ndarray
    parts: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]
    spread: np.ndarray

    @classmethod
    def of(cls, problem: Problem, values: np.ndarray) -> "Starts":
        """Directions by differences.

        Args:
            problem: the recording.
            values: of all rows, ``(R,)``.
        """
        sd, seen = problem.model.least, problem.seen
        moved = problem.begun(values)
        spread = np.sqrt((moved**2).sum(axis=0))
        parts = []
        for number in range(len(problem.trials) if len(moved) else 0):
            rows = np.flatnonzero(problem.trial == number)
            units = np.where(seen[rows], moved[:, rows] / sd, 0.0)
            way, size, _ = np.linalg.svd(
                units.reshape(len(units), -1).T, full_matrices=False
            )
            way, size = way[:, size > FELT], size[size > FELT]
            if len(size):
                parts.append((rows, way, 1 / np.sqrt(1 + size**2)))
        return cls(sd, tuple(parts), spread)

    @property
    def size(self) -> float:
        """By how much starts widen what may have been recorded, in log volume."""
        return float(-sum(np.log(left).sum() for _, _, left in self.parts))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Features or residuals ``(N, C)`` without what starts may explain of them."""
        if not self.parts:
            return values
        made = values.copy()
        for rows, way, left in self.parts:
            units = (values[rows] / self.sd).ravel()
            units = units + way @ ((left - 1) * (way.T @ units))
            made[rows] = units.reshape(len(rows), -1) * self.sd
        return made
