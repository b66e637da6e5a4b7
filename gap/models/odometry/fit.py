"""All numbers of odometry fitted together, under priors of a plausible size.

A number that a support names may be as large as such errors are; one that it does not
name is believed nominal, within a slack that no maker's figure beats. Which support
explains best is a matter of the evidence: the fit's loss, what its numbers cost under
their priors, and how much they were narrowed down.

The motions are so short that the sensor's own errors of length matter: a common error
along the travel is always among the numbers, and does not average out. This is what
makes wheels that are too large and an axle that is too short alike, until a long drive
is measured as a whole.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.gap.models.odometry.motions import (
    NUMBERS,
    TURN,
    Motions,
    changed,
    start,
)
from bns.worlds.data.units import wrapped


@dataclass(frozen=True)
class Term:
    """One candidate.

    Attributes:
        numbers: that it changes, together by the same.
        size: plausible size, one standard deviation.
        unit: of the magnitude; ratios have "1".
    """

    numbers: tuple[str, ...]
    size: float
    unit: str = "1"


TERMS: Mapping[str, Term] = {
    "axle": Term(("axle",), 0.03),
    "both_diameters": Term(("left_diameter", "right_diameter"), 0.03),
    "left_diameter": Term(("left_diameter",), 0.03),
    "right_diameter": Term(("right_diameter",), 0.03),
    "sensor_scale": Term(("sensor_scale",), 0.03),
    "mount_x": Term(("mount_x",), 0.05, "m"),
    "mount_y": Term(("mount_y",), 0.05, "m"),
    "mount_angle": Term(("mount_angle",), 1.0, "rad"),
}
FULL = tuple(name for name in TERMS if name != "both_diameters")

SLACK = np.array([3e-3, 2e-3, 2e-3, 2e-3, 2e-4, 2e-4, 1e-3])
"""by which numbers that are not named may be off nominal, one deviation; assumed"""

BOUND = np.array([0.2, 0.2, 0.2, 0.2, 0.5, 0.5, np.inf, 0.01])
"""that no number may pass; angles are wrapped instead"""

LENGTH_BIAS = 2e-4  # [m] per interval, common to all: scan matching; assumed
PER_TERM = 3.0  # natural logarithm of the odds against any one term
LOST = 6.0  # deviations from which a residual counts no more (Tukey)
LEAST = 1e-6  # [m] and [rad]: no sensor is better
DAMPING = (0.0, 0.1, 1.0, 10.0, 100.0, 1000.0)
BLOCK = 50  # intervals taken as one where what recurs is measured
LOOSE = 0.3  # [rad] a heading known no better leaves the place on a circle


@dataclass(frozen=True, eq=False)
class Noise:
    """What motions scatter by.

    Attributes:
        deviation: of one interval, per channel, robust, shape ``(3,)``.
        inflation: factor of the variance, for scatter that is not independent.
        length_bias: see `LENGTH_BIAS` [m].
    """

    deviation: np.ndarray
    inflation: float = 1.0
    length_bias: float = LENGTH_BIAS


@dataclass(frozen=True, eq=False)
class OdometryFit:
    """A support fitted to motions.

    Attributes:
        names: of its terms.
        magnitudes: of each term: relative change of nominal, or what is added.
        deviations: one standard deviation of each.
        values: changes of all `NUMBERS`, those not named within their slack.
        spread: one standard deviation of each.
        loss: weighted sum of squared deviations.
        cost: negative logarithm of the evidence, less a constant.
        signatures: whitened derivative by each term, ``(n, 3 K)``.
    """

    names: tuple[str, ...]
    magnitudes: Mapping[str, float]
    deviations: Mapping[str, float]
    values: np.ndarray
    spread: np.ndarray
    loss: float
    cost: float
    signatures: np.ndarray


@dataclass(frozen=True, eq=False)
class Problem:
    """Motions with their noise and weights: the same for every support.

    Attributes:
        motions: to explain.
        noise: of them.
        weight: what each residual counts, ``(K, 3)`` [1/m2, 1/m2, 1/rad2].
        start: changes of `NUMBERS` in closed form, shape ``(8,)``.
        unseen: terms of which the motions say nothing: nobody believes them nominal.
    """

    motions: Motions
    noise: Noise
    weight: np.ndarray
    start: np.ndarray
    unseen: tuple[str, ...] = ()

    def take(self, chosen: np.ndarray) -> "Problem":
        """Some of the intervals, by index or mask ``(K,)``, weighed as before."""
        return replace(
            self, motions=self.motions.take(chosen), weight=self.weight[chosen]
        )

    def loss(self, values: np.ndarray) -> float:
        """Weighted sum of squared residuals at changes of `NUMBERS`, ``(8,)``."""
        return float((self.weight * self.motions.rest(values) ** 2).sum())

    def normal(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normal matrix ``(8, 8)`` and pull ``(8,)`` at changes of `NUMBERS`."""
        slopes = self.motions.slopes(values).reshape(len(NUMBERS), -1)
        weighted = slopes * self.weight.ravel()
        return weighted @ slopes.T, weighted @ self.motions.rest(values).ravel()

    def fit(self, names: Sequence[str], *, slack: float = 1.0) -> OdometryFit:
        """The most plausible numbers of a support, and its evidence.

        Args:
            names: of terms; none = nominal.
            slack: factor of `SLACK`.
        """
        prior = self.prior(names, slack)
        precise = np.linalg.inv(prior)
        open_to = np.abs(_columns(names)).sum(axis=1) > 0
        starts = np.where(open_to, self.start, 0.0), np.zeros(len(NUMBERS))
        begin = min(starts, key=lambda point: self._objective(point, precise))
        return self._summary(tuple(names), self._descend(begin, precise), prior)

    def costs(self, supports: Sequence[Sequence[str]], near: np.ndarray) -> np.ndarray:
        """Evidence of many supports, predictions taken as linear.

        Args:
            supports: terms of each.
            near: changes of `NUMBERS` about which they are linear, shape ``(8,)``.

        Returns:
            As `OdometryFit.cost`, one by support.
        """
        matrix, pull = self.normal(near)
        matrix, pull = matrix / self.noise.inflation, pull / self.noise.inflation
        target = pull + matrix @ near
        whole = self.loss(near) / self.noise.inflation + (pull + target) @ near
        made = []
        for names in supports:
            prior = self.prior(names)
            inner = np.eye(len(prior)) + prior @ matrix
            values = np.linalg.solve(inner, prior @ target)
            evidence = whole - target @ values + _logdet(inner)
            made.append(evidence / 2 + PER_TERM * len(names))
        return np.array(made)

    def prior(self, names: Sequence[str], slack: float = 1.0) -> np.ndarray:
        """Covariance of all numbers before anything is seen, ``(8, 8)``."""
        least = np.append(np.maximum(slack, 1e-6) * SLACK, self.noise.length_bias)
        wide = tuple(dict.fromkeys((*names, *self.unseen)))
        columns = _columns(wide) * [TERMS[name].size for name in wide]
        return np.diag(np.maximum(least, 1e-9) ** 2) + columns @ columns.T

    def _objective(self, values: np.ndarray, precise: np.ndarray) -> float:
        return self.loss(values) / self.noise.inflation + values @ precise @ values

    def _descend(self, point: np.ndarray, precise: np.ndarray) -> np.ndarray:
        """Damped Gauss-Newton steps within bounds, taken where they help."""
        point = np.clip(point, -BOUND, BOUND)
        now = self._objective(point, precise)
        for _ in range(40):
            matrix, pull = self.normal(point)
            matrix = matrix / self.noise.inflation + precise
            pull = pull / self.noise.inflation - precise @ point
            for damping in DAMPING:
                damped = matrix + damping * np.diag(np.diag(matrix))
                trial = np.clip(point + np.linalg.solve(damped, pull), -BOUND, BOUND)
                trial[TURN] = wrapped(trial[TURN])
                then = self._objective(trial, precise)
                if then < now:
                    break
            else:
                return point
            gained, point, now = now - then, trial, then
            if gained < 1e-5:
                return point
        return point

    def _summary(
        self, names: tuple[str, ...], values: np.ndarray, prior: np.ndarray
    ) -> OdometryFit:
        matrix = self.normal(values)[0] / self.noise.inflation
        precise = np.linalg.inv(prior)
        after = np.linalg.inv(matrix + precise)
        size = np.array([TERMS[name].size for name in names])
        gain = (_columns(names) * size**2).T @ precise  # terms given the numbers
        left = np.diag(size**2) - gain @ _columns(names) * size**2
        spread = np.sqrt(_on_circle(values, np.diag(after)))
        own = np.sqrt(np.maximum(np.diag(left + gain @ after @ gain.T), 0.0))
        for at, name in enumerate(names):
            if name.startswith("mount"):
                own[at] = spread[NUMBERS.index(name)]
        evidence = self._objective(values, precise) + _logdet(
            np.eye(len(prior)) + prior @ matrix
        )
        slopes = self.motions.slopes(values).reshape(len(NUMBERS), -1)
        return OdometryFit(
            names=names,
            magnitudes=dict(zip(names, (gain @ values).tolist(), strict=True)),
            deviations=dict(zip(names, own.tolist(), strict=True)),
            values=values,
            spread=spread,
            loss=self.loss(values),
            cost=float(evidence / 2 + PER_TERM * len(names)),
            signatures=_columns(names).T @ (slopes * np.sqrt(self.weight.ravel())),
        )


def _columns(names: Sequence[str]) -> np.ndarray:
    """What each term changes, ``(8, n)``."""
    columns = [changed(dict.fromkeys(TERMS[name].numbers, 1.0)) for name in names]
    return np.array(columns).reshape(-1, len(NUMBERS)).T


def _logdet(matrix: np.ndarray) -> float:
    return float(np.linalg.slogdet(matrix)[1])


def _on_circle(values: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Variances, the place's no smaller than its circle's where the heading is open."""
    variance = variance.copy()
    if variance[TURN] > LOOSE**2:
        place = slice(TURN - 2, TURN)
        variance[place] += (values[place] ** 2).sum() / 2
    return variance


def problem(motions: Motions, *, length_bias: float = LENGTH_BIAS) -> Problem:
    """Noise and weights from what the fit of all numbers leaves.

    Args:
        motions: many short intervals.
        length_bias: common error of the sensor's lengths per interval, one deviation
            [m].
    """
    begin = start(motions)
    moves = np.abs(motions.left) + np.abs(motions.right) > 0
    chosen = moves if moves.any() else ~moves
    values = begin
    for _ in range(4):
        rest = motions.rest(values)
        size = 1.4826 * np.median(np.abs(rest[chosen]), axis=0)
        noise = Noise(np.maximum(size, LEAST), length_bias=length_bias)
        tukey = np.clip(1 - (rest / (LOST * noise.deviation)) ** 2, 0.0, None) ** 2
        made = Problem(motions, noise, tukey / noise.deviation**2, begin)
        values = made.fit(FULL).values
    noise = replace(noise, inflation=_inflation(made, values))
    return replace(made, noise=noise)


def _inflation(made: Problem, values: np.ndarray) -> float:
    """Variance of what is fitted over that of normal, independent residuals.

    Heavy tails count by the variance of an M-estimator, ``E psi^2 / (E psi')^2``
    (Huber, Robust Statistics, 1981, eq. 3.2.13). What is not independent counts by the
    larger of what the autocorrelation of the rest says and what the pulls of whole
    blocks say (a covariance that is robust to clusters).
    """
    rest = made.motions.rest(values) / made.noise.deviation
    share = np.minimum((rest / LOST) ** 2, 1.0)
    weight, slope = (1 - share) ** 2, (1 - share) * (1 - 5 * share)
    square = ((weight * rest) ** 2).mean()
    tails = square * weight.mean() / slope.mean() ** 2
    root = np.sqrt(weight) * rest
    sums = [1 + 2 * sum(_positive(root[:, at])) for at in range(3)]
    slopes = made.motions.slopes(values) * np.sqrt(made.weight)
    edges = np.arange(0, len(root), BLOCK)
    blocks = np.add.reduceat((slopes * root).sum(axis=2), edges, axis=1)
    alone = ((slopes * root) ** 2).sum(axis=(1, 2))
    seen = alone > 1e-12 * alone.max()
    ratio = np.median((blocks**2).sum(axis=1)[seen] / alone[seen])
    dependent = max(1.0, np.mean(sums), ratio if len(edges) >= 8 else 1.0)
    return float(max(1.0, tails) * dependent)


def _positive(values: np.ndarray) -> list[float]:
    """Autocorrelations up to the first that is not positive."""
    whole, found = float(values @ values), []
    for lag in range(1, min(BLOCK, len(values) // 4)):
        share = float(values[lag:] @ values[:-lag]) / whole if whole else 0.0
        if share <= 2 / np.sqrt(len(values)):
            break
        found.append(share)
    return found
