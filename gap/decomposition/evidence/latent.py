"""What is not known of each trial: the state in which it began, and when its commands
did.

A trial that is cut from a recording begins in motion, in a state that the data tell to
within their noise. A log that tells commands at its samples alone leaves open when,
since the sample before, each of them began. An error there grows or dies with the
motion, so that residuals of one trial go together, in all channels: their covariance is
that of the measurement plus one direction for each such number. Residuals are made
independent again by shrinking what lies in these directions (Woodbury's identity).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bns.gap.decomposition.evidence import noise
from bns.gap.decomposition.problem import Problem

FELT = 0.1  # deviations of a residual's noise: less is not felt


@dataclass(frozen=True, eq=False)
class Latent:
    """Directions of the unknown numbers of each trial.

    Attributes:
        sd: of the measurement by feature, ``(C,)``.
        parts: of each trial that has some: its windows, orthonormal directions
            ``(n * C, k)``, and what is left of a residual in each ``(k,)``.
        spread: standard deviation that they give each feature, ``(N, C)``.
        begun: what starts change, see `Problem.begun`.
    """

    sd: np.ndarray
    parts: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]
    spread: np.ndarray
    begun: np.ndarray

    @classmethod
    def of(cls, problem: Problem, values: np.ndarray, rest: np.ndarray) -> "Latent":
        """Directions by differences.

        Args:
            problem: the recording.
            values: of all rows, ``(R,)``, for what starts change; when commands began
                changes what it does to the nominal model.
            rest: residuals there, ``(N, C)``, see `beside`.
        """
        return cls._made(problem, problem.begun(values), rest)

    def beside(self, problem: Problem, rest: np.ndarray) -> "Latent":
        """The same beside other residuals: moments of commands that change less than
        what else is left are not what is left.

        Args:
            problem: the recording.
            rest: residuals, ``(N, C)``.
        """
        if not problem.any_open:
            return self
        left = self(np.nan_to_num(rest))
        return self._made(problem, self.begun, np.where(problem.seen, left, np.nan))

    @classmethod
    def _made(cls, problem: Problem, begun: np.ndarray, rest: np.ndarray) -> "Latent":
        sd, seen = problem.model.least, problem.seen
        share = sd / np.maximum(noise.level(rest), sd) if problem.any_open else 1.0
        square = (begun**2).sum(axis=0)
        parts = []
        for number, sooner in enumerate(problem.open_commands):
            rows = np.flatnonzero(problem.trial == number)
            moved = np.concatenate([begun[:, rows], share * sooner])
            square[rows] += (sooner**2).sum(axis=0)
            if not len(moved):
                continue
            units = np.where(seen[rows], moved / sd, 0.0).reshape(len(moved), -1)
            square_of, mixed = np.linalg.eigh(units @ units.T)
            felt = square_of > FELT**2
            size = np.sqrt(square_of[felt])
            if len(size):
                way = units.T @ (mixed[:, felt] / size)
                parts.append((rows, way, 1 / np.sqrt(1 + size**2)))
        return cls(sd, tuple(parts), np.sqrt(square), begun)

    @property
    def size(self) -> float:
        """By how much they widen what may have been recorded, in log volume."""
        return float(-sum(np.log(left).sum() for _, _, left in self.parts))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Features or residuals ``(..., N, C)`` without what these may explain of
        them."""
        if not self.parts:
            return values
        made = values.copy()
        for rows, way, left in self.parts:
            part = values[..., rows, :] / self.sd
            units = part.reshape(*part.shape[:-2], -1)
            units = units + ((units @ way) * (left - 1)) @ way.T
            made[..., rows, :] = units.reshape(part.shape) * self.sd
        return made

    def of_each(self, slopes: Mapping[int, np.ndarray]) -> dict[int, np.ndarray]:
        """Derivatives ``(N, C)`` by number of the row, all at once."""
        return dict(zip(slopes, self(np.stack([*slopes.values()])), strict=True))
