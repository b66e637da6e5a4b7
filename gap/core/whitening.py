"""Residuals made independent with unit variance, and the loss on them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from bns.gap.core.floor import Floor, derivative
from bns.gap.models.base import GapModel, Windows
from bns.worlds.trial import Trial

CLIP = 4.0  # standard deviations beyond which the loss grows linearly


@dataclass(frozen=True, eq=False)
class Whitener:
    """Turns differences of features into whitened vectors.

    The covariance of a trial's features holds the measurement's noise, which
    neighbouring windows share, and the scatter of motion itself. Directions in which
    the nominal model is known to be uncertain (`Candidate.slack`) are damped: to a
    likelihood that is the same as marginalising over them.

    Attributes:
        factors: lower Cholesky factor per trial.
        rows: rows of each trial in a whitened vector.
        basis: orthonormal directions of uncertainty, ``(N, k)``.
        damping: what is taken off along each, 0..1, shape ``(k,)``.
    """

    factors: tuple[np.ndarray, ...]
    rows: tuple[slice, ...]
    basis: np.ndarray
    damping: np.ndarray

    @classmethod
    def of(
        cls,
        model: GapModel,
        trials: Sequence[Trial],
        windows: Sequence[Windows],
        floor: Floor,
    ) -> "Whitener":
        """The whitener of a recording, without uncertain directions.

        Args:
            model: nominal model.
            trials: the recording.
            windows: of each trial.
            floor: what measuring and the robot itself scatter.
        """
        factors, rows, at = [], [], 0
        for trial, parts in zip(trials, windows, strict=True):
            jacobian = derivative(model, trial, parts) * floor.sigma
            flat = jacobian.reshape(len(jacobian), -1)
            own = np.outer(parts.durations, floor.process**2).ravel()
            factors.append(cholesky(flat @ flat.T + np.diag(own), lower=True))
            rows.append(slice(at, at + len(own)))
            at += len(own)
        empty = np.zeros((at, 0))
        return cls(tuple(factors), tuple(rows), empty, np.zeros(0))

    def uncertain(self, directions: np.ndarray) -> "Whitener":
        """With further uncertainty: whitened directions, one sd long, ``(k, N)``."""
        if not len(directions):
            return self
        basis, size, _ = np.linalg.svd(directions.T, full_matrices=False)
        damping = 1 - 1 / np.sqrt(1 + size**2)
        return Whitener(self.factors, self.rows, basis, damping)

    def __call__(self, features: Sequence[np.ndarray]) -> np.ndarray:
        """Whitened features.

        Args:
            features: per trial ``(W, C)``; differences of features.

        Returns:
            ``(N,)``; NaN anywhere if any is not finite.
        """
        return self.many([values[None] for values in features])[0]

    def many(self, features: Sequence[np.ndarray]) -> np.ndarray:
        """Whitened features of E predictions: per trial ``(E, W, C)``; ``(E, N)``."""
        parts = [
            solve_triangular(
                factor,
                values.reshape(len(values), -1).T,
                lower=True,
                check_finite=False,
            ).T
            for factor, values in zip(self.factors, features, strict=True)
        ]
        return self.damp(np.concatenate(parts, axis=1))

    def damp(self, z: np.ndarray) -> np.ndarray:
        """The uncertain directions damped; ``(..., N)``."""
        return z - ((z @ self.basis) * self.damping) @ self.basis.T


def loss(z: np.ndarray) -> np.ndarray:
    """Square up to `CLIP` standard deviations, linear beyond; summed, ``(...,)``."""
    return terms(z).sum(axis=-1)


def terms(z: np.ndarray) -> np.ndarray:
    """What each whitened residual adds to the loss."""
    size = np.abs(z)
    return np.where(size <= CLIP, size**2, CLIP * (2 * size - CLIP))


def weights(z: np.ndarray) -> np.ndarray:
    """Root weight of each residual that makes least squares of the loss."""
    return np.sqrt(np.minimum(1.0, CLIP / np.maximum(np.abs(z), 1e-12)))
