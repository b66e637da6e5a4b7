"""How large residuals are that nothing explains, measured from a joint fit's rest.

The standard deviation of a feature grows with its motion and with what explanations
change of it, ``s^2 = a^2 + b^2 v^2 + c^2 m^2``: `a` is the measurement's, `b` holds the
jitter of time stamps times speed and scatter in proportion to speed, `c` how inexactly
the simulation shows what it explains (a wheel that slides is predicted to a fifth, one
that is 3 % larger to a hundredth). Tails are heavy, so all is robust, and neighbouring
residuals are correlated, so they count as fewer.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from bns.gap.decomposition.evidence.linear import Linear

NORMAL = 1.4826  # standard deviation over the median of |x| of a normal
CLIP = 3.5  # robust deviations beyond which squares are cut
HUBER = 2.5  # deviations at which residuals begin to count linearly
LAGS = 25  # windows over which residuals may be correlated


def scale(
    rest: np.ndarray,
    motion: np.ndarray,
    least: np.ndarray,
    change: np.ndarray | None = None,
) -> np.ndarray:
    """Standard deviation of each residual, ``(N, C)``.

    Args:
        rest: residuals, ``(N, C)``; NaN = not seen.
        motion: size of the predicted motion, ``(N, C)``.
        least: smallest deviations that are believed, ``(C,)``.
        change: what explanations change of the prediction, ``(N, C)``; None = nothing.
    """
    made = np.empty_like(rest)
    for column, low in enumerate(least):
        seen = np.isfinite(rest[:, column])
        error, speed = np.abs(rest[seen, column]), np.abs(motion[seen, column])
        if not len(error):
            made[:, column] = low
            continue
        parts = [np.ones_like(speed), speed**2]
        if change is not None and change[seen, column].any():
            parts.append(change[seen, column] ** 2)
        variance = np.maximum(_variance(error, np.stack(parts, axis=1)), low**2)
        heavy = NORMAL * np.median(error / np.sqrt(variance))
        made[:, column] = np.sqrt(variance.mean())
        made[seen, column] = np.sqrt(variance) * max(heavy, 0.7)
    return np.maximum(made, least)


def _variance(error: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Non-negative combination of parts ``(N, K)`` nearest to clipped squares."""
    middle = max(NORMAL * np.median(error), 1e-12)
    size = parts.std(axis=0) + parts.mean(axis=0) + 1e-30
    variance = np.full(len(error), middle**2)
    for _ in range(5):
        squares = np.minimum(error**2, CLIP**2 * variance)
        weight = 1 / variance
        found, _ = nnls(parts / size * weight[:, None], squares * weight)
        variance = parts @ (found / size)
        variance = np.maximum(variance, 1e-4 * variance.mean() + 1e-30)
    return 1.02 * variance


def level(rest: np.ndarray) -> np.ndarray:
    """Robust standard deviation of each column of residuals ``(N, C)``, ``(C,)``; 0
    where none was seen (NaN)."""
    return np.nan_to_num(NORMAL * np.nanmedian(np.abs(rest), axis=0))


def loss(rest: np.ndarray, sd: np.ndarray) -> float:
    """Pseudo-Huber loss of residuals ``(N, C)`` with standard deviations ``(N, C)``:
    their weighted square where they are small."""
    units = np.nan_to_num(rest) / sd / HUBER
    return float((2 * HUBER**2 * (np.sqrt(1 + units**2) - 1)).sum())


def weights(rest: np.ndarray, sd: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Weights of squares whose gradient is that of `loss`, ``(N, C)``.

    Args:
        rest: residuals, ``(N, C)``.
        sd: their standard deviations, ``(N, C)``.
        seen: which of them were seen, ``(N, C)``; others weigh nothing.
    """
    units = np.nan_to_num(rest) / sd / HUBER
    return np.where(seen, 1 / np.sqrt(1 + units**2) / sd**2, 0.0)


def correlated(whitened: np.ndarray, trial: np.ndarray) -> float:
    """As how many residuals one independent residual counts, 1 at least.

    Args:
        whitened: residuals in deviations, ``(N, C)``.
        trial: number of the trial of each, ``(N,)``.

    Returns:
        One plus twice the first positive run of the autocorrelation, the mean over
        channels; negative correlation is no structure.
    """
    found = []
    for column in whitened.T:
        sums, counts = np.zeros(LAGS + 1), np.zeros(LAGS + 1)
        for number in np.unique(trial):
            part = column[trial == number]
            for lag in range(min(LAGS + 1, len(part))):
                sums[lag] += part[lag:] @ part[: len(part) - lag]
                counts[lag] += len(part) - lag
        rho = sums / np.maximum(counts, 1) / max(sums[0] / max(counts[0], 1), 1e-30)
        ends = np.flatnonzero(rho < 0.05)
        run = ends[0] if len(ends) else LAGS
        found.append(1 + 2 * rho[1:run].sum())
    return max(1.0, float(np.mean(found)))


def inflation(linear: Linear, values: np.ndarray) -> float:
    """Variance of the stretches' scores over that of independent residuals.

    The cluster-robust variance (Liang and Zeger, Biometrika 73, 1986) sees windows that
    overlap, correlation of either sign and repeats; median over rows.
    """
    sums = (linear.scores(values) ** 2).sum(axis=0)
    size = np.diagonal(linear.normal.sum(axis=0))
    told = size > 1.0
    count = len(linear.square)
    if not told.any():
        return 1.0
    return float(np.median(sums[told] / size[told])) * count / max(count - 1, 1)


@dataclass(frozen=True, eq=False)
class Memory:
    """An autoregression of the residuals of each channel, which is taken out.

    Attributes:
        factors: by channel and lag, ``(C, order)``; empty order = none.
        gain: size of an innovation over that of a residual, ``(C,)``.
        trial: number of the trial of each residual, ``(N,)``.
    """

    factors: np.ndarray
    gain: np.ndarray
    trial: np.ndarray

    @classmethod
    def none(cls, trial: np.ndarray, channels: int) -> "Memory":
        """One that changes nothing of residuals of trials ``(N,)``."""
        return cls(np.zeros((channels, 0)), np.ones(channels), trial)

    @classmethod
    def of(cls, rest: np.ndarray, trial: np.ndarray, order: int) -> "Memory":
        """The autoregression of a rest, by its clipped autocovariance.

        Args:
            rest: residuals, ``(N, C)``.
            trial: number of the trial of each, ``(N,)``.
            order: number of lags; 0 = no memory.
        """
        if order == 0:
            return cls.none(trial, rest.shape[1])
        factors = np.array([_regression(c, trial, order) for c in rest.T])
        made = cls(factors, np.ones(rest.shape[1]), trial)
        sizes = np.median(np.abs(rest), axis=0) + 1e-30
        gain = np.minimum(1.0, np.median(np.abs(made(rest)), axis=0) / sizes)
        return cls(factors, gain, trial)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Innovations of ``(N, C)``. The first of each trial keep their own value, in
        proportion, so that an offset is not lost."""
        order = self.factors.shape[1]
        if order == 0:
            return values
        made = values.copy()
        for number in np.unique(self.trial):
            rows = np.flatnonzero(self.trial == number)
            part, out = values[rows], values[rows].copy()
            for lag in range(1, order + 1):
                out[lag:] -= self.factors[:, lag - 1] * part[:-lag]
            out[:order] = part[:order] * self.gain
            made[rows] = out
        return made


def _regression(column: np.ndarray, trial: np.ndarray, order: int) -> np.ndarray:
    size = NORMAL * np.median(np.abs(column)) + 1e-30
    clipped = np.clip(column, -4 * size, 4 * size)
    sums, counts = np.zeros(order + 1), np.zeros(order + 1)
    for number in np.unique(trial):
        part = clipped[trial == number]
        for lag in range(order + 1):
            sums[lag] += part[lag:] @ part[: len(part) - lag]
            counts[lag] += len(part)
    sums /= np.maximum(counts, 1)
    lags = np.abs(np.subtract.outer(range(order), range(order)))
    return np.linalg.solve(sums[lags] + 1e-3 * sums[0] * np.eye(order), sums[1:])
