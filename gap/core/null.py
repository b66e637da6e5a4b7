"""How large an improvement chance alone gives: calibrated p-values."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as fisher

from bns import seeding
from bns.gap.core.problem import Problem
from bns.gap.core.signatures import Curves
from bns.gap.core.whitening import terms

DRAWS = 1000
LARGEST = 25.0  # square of a residual that counts in full
QUIET = 0.5  # share of the assumed noise below which a rest counts as that much
LAGS = 10  # windows over which a rest may be correlated with itself
POWER = 1.2816  # standard normal: 90 %
TAIL = 0.05  # share of the draws beyond which chance is taken to fall exponentially
EXACT = 1.001  # times the resolution up to which noise counts as raised to it
CLEAR = 3.0  # standard errors from which a correlation is counted


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
        """By drawing whitened recordings without an effect.

        Args:
            problem: the recording.
            curves: its signatures.
            seed: of the drawn recordings.
        """
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
        """Probability of so large an improvement by one effect if there is none.

        Of the draws where there are enough as large ones; beyond, chance falls
        exponentially, as the squares of normal numbers do, at the draws' own rate.
        """
        begin = self.threshold(TAIL)
        if gain <= begin:
            above = len(self.gains) - np.searchsorted(self.gains, gain)
            return float((1 + above) / (1 + len(self.gains)))
        fall = float((self.gains[self.gains > begin] - begin).mean())
        return float(TAIL * np.exp(-(gain - begin) / max(fall, 1e-9)))

    def threshold(self, alpha: float) -> float:
        """Improvement that chance exceeds with probability `alpha`."""
        return float(np.quantile(self.gains, 1 - alpha))

    @property
    def seen(self) -> float:
        """Whitened length of a signature that is found with 90 % power."""
        return float(np.sqrt(self.threshold(0.05)) + POWER)

    def misfit(self, problem: Problem, z: np.ndarray) -> tuple[float, float]:
        """Whether a whitened rest still has structure, and how much.

        Two tests: what the flexible model explains of it, and its correlation with
        itself in time; the smaller p-value counts twice. Both take how far the rest
        scatters from the rest itself. How much it is comes in units of the loss, so
        that it compares with what effects explain. A rest within the accuracy of a
        tracker that scatters less than it is exact is the tracker's own.

        Returns:
            p-value; loss of what has structure, beyond chance.
        """
        by_channel = z.reshape(-1, len(problem.model.features))
        limited = np.sqrt(np.minimum(by_channel**2, LARGEST).mean(axis=0))
        # where the noise is known, a rest is never less than that
        known = problem.floor.source == "model"
        scale = np.maximum(limited, 1.0 if known else QUIET)
        bounded = np.clip(by_channel / scale, -5, 5)
        bounded[:, quiet(problem) & (limited < 1)] = 0.0
        explained = float(((bounded.ravel() @ self.basis) ** 2).sum())
        degrees = self.basis.shape[1]
        free = len(z) - degrees
        p = fisher.sf(explained / max(degrees, 1), degrees, free) if free > 0 else 1.0
        found = correlation(problem, bounded)
        p = min(1.0, 2 * min(p, chi2.sf((found.size**2).sum(), found.size.size)))
        clear = np.where(np.abs(found.size) > CLEAR, np.abs(found.share), 0.0)
        smooth = float((clear.max(axis=0) * terms(by_channel).sum(axis=0)).sum())
        along = (bounded * scale).ravel() @ self.basis
        beyond = float((along**2).sum()) - degrees * float((scale**2).mean())
        return float(p), max(smooth, beyond, 0.0)


def quiet(problem: Problem) -> np.ndarray:
    """Features whose noise is below what the instrument is exact to, ``(C,)``.

    Such noise was raised to the model's `resolution`. What it hides are errors that
    come again at the same pose, and so neither scatter nor average out.
    """
    model, sigma = problem.model, problem.floor.sigma
    if problem.floor.source == "model":
        return np.zeros(len(model.features), dtype=bool)
    raised = [
        (channel.unit, value <= EXACT * least)
        for channel, value, least in zip(
            model.channels, sigma, model.resolution, strict=True
        )
    ]
    units = {unit for unit, _ in raised}
    low = {
        unit for unit in units if all(is_low for own, is_low in raised if own == unit)
    }
    return np.array([feature.unit in low for feature in model.features])


def lasting(problem: Problem, z: np.ndarray) -> float:
    """Variance of a rest's sums over that of independent residuals, at least 1.

    Taken of `quiet` features alone: their errors last over windows, and an effect that
    goes with them improves the loss by as much more.
    """
    own = quiet(problem)
    if not own.any():
        return 1.0
    by_channel = z.reshape(-1, len(own))
    scale = np.sqrt((by_channel**2).mean(axis=0)) + 1e-12
    found = correlation(problem, np.clip(by_channel / scale, -5, 5))
    clear = np.where(found.size > CLEAR, found.share, 0.0)[:, own]
    return 1.0 + 2.0 * float(clear.sum(axis=0).max())


def spread(z: np.ndarray) -> float:
    """Robust standard deviation, at least `QUIET`.

    What a simulated recording without noise leaves is pure structure, however small it
    is; far below the noise it says nothing of the robot.
    """
    return max(float(np.median(np.abs(z))) / 0.6745, QUIET)


class Correlation(NamedTuple):
    """Correlation of a rest with itself, by lag and channel, ``(LAGS, C)``.

    Attributes:
        size: in standard errors.
        share: of the rest's variance.
    """

    size: np.ndarray
    share: np.ndarray


def correlation(problem: Problem, z: np.ndarray) -> Correlation:
    """How windows of a rest go with those that follow.

    Args:
        problem: the recording.
        z: whitened rest, about one in size, ``(W, C)``.
    """
    shape = min(LAGS, max(map(len, problem.windows)) - 1), z.shape[1]
    sums, squares, count = np.zeros(shape), np.zeros(shape), np.zeros((shape[0], 1))
    for rows in problem.whiten.rows:
        piece = z[rows.start // shape[1] : rows.stop // shape[1]]
        for lag in range(1, min(shape[0], len(piece) - 1) + 1):
            products = piece[lag:] * piece[:-lag]
            sums[lag - 1] += products.sum(axis=0)
            squares[lag - 1] += (products**2).sum(axis=0)
            count[lag - 1] += len(products)
    variance = np.maximum((z**2).mean(axis=0), 1e-12)
    return Correlation(
        sums / np.sqrt(np.maximum(squares, count)), sums / count / variance
    )


def flexible(problem: Problem) -> np.ndarray:
    """Whitened, orthonormal directions of a flexible model of the gap.

    Each feature channel is a linear function of what went on in the window: commands,
    their sizes, signs and recent changes, products, heading, position and time.

    Returns:
        ``(N, k)``: k directions of N whitened residuals.
    """
    made = [
        columns(problem.model.regime(trial, windows))
        for trial, windows in zip(problem.trials, problem.windows, strict=True)
    ]
    pooled = np.concatenate(made)
    scale = pooled.std(axis=0)
    keep = scale > 1e-9 * (1 + np.abs(pooled).max(axis=0))
    keep[0] = True  # the constant
    scale = np.where(scale > 0, scale, 1.0)
    channels = len(problem.model.features)
    rows = []
    for channel in range(channels):
        for column in np.flatnonzero(keep):
            values = []
            for piece, windows in zip(made, problem.windows, strict=True):
                feature = np.zeros((len(piece), channels))
                feature[:, channel] = piece[:, column] / scale[column]
                feature[:, channel] *= windows.durations
                values.append(feature)
            rows.append(problem.whiten(values))
    matrix = np.array(rows).T
    matrix /= np.linalg.norm(matrix, axis=0) + 1e-300
    left, size, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, size > 1e-6 * size[0]]


def columns(regime) -> np.ndarray:
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
