"""How large an improvement chance alone gives: calibrated p-values."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from bns import seeding
from bns.gap.problem import Problem
from bns.gap.signatures import Curves

DRAWS = 1000
LARGEST = 25.0  # square of a residual that counts in full
QUIET = 0.5  # share of the assumed noise below which a rest counts as that much
LAGS = 10  # windows over which a rest may be correlated with itself


@dataclass(frozen=True, eq=False)
class Null:
    """What recordings without any effect give.

    Attributes:
        gains: largest improvement by any level of any candidate, sorted, ``(D,)``.
        basis: orthonormal whitened directions of the flexible model, ``(N, k)``.
    """

    gains: np.ndarray
    basis: np.ndarray

    @classmethod
    def of(cls, problem: Problem, curves: Curves, *, seed: int = 0) -> "Null":
        """By drawing whitened recordings without an effect."""
        rng = seeding.generator(seed, "gap", "null")
        rows = curves.signature
        size = np.maximum((rows.astype(float) ** 2).sum(axis=1), 1e-12)
        draws = rng.standard_normal((DRAWS, rows.shape[1])).astype(np.float32)
        # best position between the nominal and each level
        along = draws @ rows.T
        gain = np.where(
            along > size, 2 * along - size, np.maximum(along, 0) ** 2 / size
        )
        return cls(np.sort(gain.max(axis=1)), flexible(problem))

    def p_gain(self, gain: float) -> float:
        """Probability of so large an improvement by one effect if there is none."""
        above = len(self.gains) - np.searchsorted(self.gains, gain)
        return float((1 + above) / (1 + len(self.gains)))

    def threshold(self, alpha: float) -> float:
        """Improvement that chance exceeds with probability `alpha`."""
        return float(np.quantile(self.gains, 1 - alpha))

    def misfit(self, problem: Problem, z: np.ndarray) -> tuple[float, float]:
        """Whether a whitened rest still has structure.

        Two tests: what the flexible model explains of it, and its correlation with
        itself in time; the smaller p-value counts twice.

        Returns:
            p-value; what the flexible model would improve beyond chance.
        """
        by_channel = z.reshape(-1, len(problem.model.features))
        known = problem.floor.source == "model"  # noise that is no more to be found
        size = rough if known else spread
        scale = np.array([size(column) for column in by_channel.T])
        z = np.clip(by_channel / scale, -5, 5).ravel()
        explained = float(((z @ self.basis) ** 2).sum())
        degrees = self.basis.shape[1]
        p_flexible = chi2.sf(explained, degrees)
        correlated, lags = _correlation(problem, z)
        p = min(1.0, 2 * min(p_flexible, chi2.sf(correlated, lags)))
        return float(p), max(explained - degrees, correlated - lags, 0.0)


def spread(z: np.ndarray) -> float:
    """Robust standard deviation, at least `QUIET`.

    What a simulated recording without noise leaves is pure structure, however small it
    is; far below the noise it says nothing of the robot.
    """
    return max(float(np.median(np.abs(z))) / 0.6745, QUIET)


def rough(z: np.ndarray) -> float:
    """Root mean square of residuals, the largest limited, but not below the noise."""
    return max(float(np.sqrt(np.minimum(z**2, LARGEST).mean())), 1.0)


def _correlation(problem: Problem, z: np.ndarray) -> tuple[float, int]:
    channels = len(problem.model.features)
    sums, count = np.zeros((LAGS, channels)), np.zeros(LAGS)
    for rows in problem.whiten.rows:
        piece = z[rows].reshape(-1, channels)
        for lag in range(1, min(LAGS, len(piece) - 1) + 1):
            sums[lag - 1] += (piece[lag:] * piece[:-lag]).sum(axis=0)
            count[lag - 1] += len(piece) - lag
    used = count > 0
    return float((sums[used] ** 2 / count[used, None]).sum()), int(
        used.sum()
    ) * channels


def flexible(problem: Problem) -> np.ndarray:
    """Whitened, orthonormal directions of a flexible model of the gap.

    Each feature channel is a linear function of what went on in the window: commands,
    their sizes, signs and recent changes, products, heading, position and time.
    """
    columns = [
        terms(problem.model.regime(trial, windows))
        for trial, windows in zip(problem.trials, problem.windows, strict=True)
    ]
    pooled = np.concatenate(columns)
    scale = pooled.std(axis=0)
    keep = scale > 1e-9 * (1 + np.abs(pooled).max(axis=0))
    keep[0] = True  # the constant
    scale = np.where(scale > 0, scale, 1.0)
    channels = len(problem.model.features)
    rows = []
    for channel in range(channels):
        for column in np.flatnonzero(keep):
            values = []
            for piece, windows in zip(columns, problem.windows, strict=True):
                feature = np.zeros((len(piece), channels))
                feature[:, channel] = piece[:, column] / scale[column]
                feature[:, channel] *= windows.durations
                values.append(feature)
            rows.append(problem.whiten(values))
    matrix = np.array(rows).T
    matrix /= np.linalg.norm(matrix, axis=0) + 1e-300
    left, size, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, size > 1e-6 * size[0]]


def terms(regime) -> np.ndarray:
    """Columns of the flexible model in each window, ``(W, k)``; the first constant."""
    values = list(regime.values())
    width = len(values[0])
    made = [np.ones(width)]
    for name, value in regime.items():
        if name == "heading":
            made += [np.cos(value), np.sin(value)]
        elif name.startswith("time since"):
            made += [np.exp(-value / 0.15), np.exp(-value / 0.5)]
        else:
            made += [value, np.abs(value), np.sign(value), value * np.abs(value)]
    recent = next((v for n, v in regime.items() if n.startswith("time since")), None)
    if recent is not None:
        for name, value in regime.items():
            if name.startswith("change"):
                made += [value * np.exp(-recent / 0.15), value * np.exp(-recent / 0.5)]
                made += [np.abs(value) * np.exp(-recent / 0.3)]
    return np.stack(made, axis=1)
