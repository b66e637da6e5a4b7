"""Scores of candidates on the runs of one servo setting, whitened."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.gap.decomposition.row import Row
from bns.gap.models.servo import curves as servo_curves
from bns.gap.models.servo.candidates import ratio
from bns.gap.models.servo.curves import Curve
from bns.gap.models.servo.discrepancy import Discrepancy
from bns.gap.models.servo.nominal import Nominal
from bns.gap.models.servo.runs import Runs

FINE = np.linspace(-1, 1, 9)  # magnitudes tried again around the best, in grid steps


@dataclass(frozen=True, eq=False)
class Scores:
    """What each candidate leaves unexplained.

    Attributes:
        nothing: whitened sum of squares of the nominal law.
        costs: the same under each candidate at its best, by name.
        magnitudes: those best magnitudes.
        signatures: whitened departures there, each shape ``(D,)``.
        profiles: magnitudes and costs that were tried near the best, by name.
        size: number of whitened values.
    """

    nothing: float
    costs: Mapping[str, float]
    magnitudes: Mapping[str, float]
    signatures: Mapping[str, np.ndarray]
    profiles: Mapping[str, tuple[np.ndarray, np.ndarray]]
    size: int

    @property
    def ranked(self) -> list[str]:
        """Names, the best first."""
        return sorted(self.costs, key=self.costs.__getitem__)

    @property
    def statistic(self) -> float:
        """Logarithm of what nothing leaves over what the best leaves; no unit of noise.

        The scale of the nominal law's own errors cancels: it differs between settings.
        """
        return float(np.log(self.nothing / self.costs[self.ranked[0]]))

    def worse(self, name: str) -> float:
        """By how much a candidate is behind the best, as a logarithm."""
        return float(np.log(self.costs[name] / self.costs[self.ranked[0]]))


def score(
    residuals: np.ndarray, curves: Sequence[Curve], whiteners: Sequence[np.ndarray]
) -> Scores:
    """Fit each candidate along its curve.

    Args:
        residuals: recorded minus nominal, R merged runs of one setting, ``(R, F)``.
        curves: of all candidates on the same runs.
        whiteners: one ``(F, F)`` matrix per run.
    """
    target = _whitened(residuals[:, None], whiteners)[0]
    costs, magnitudes, signatures, profiles = {}, {}, {}, {}
    for curve in curves:
        name = curve.candidate.name
        points = _whitened(curve.departures, whiteners)
        log = ratio(curve.candidate)
        cost, best = servo_curves.nearest(points, target, curve.magnitudes, log)
        costs[name], magnitudes[name] = cost, best
        signatures[name] = _between(points, curve.magnitudes, best)
        profiles[name] = (curve.magnitudes, ((points - target) ** 2).sum(axis=1))
    return Scores(
        float(target @ target), costs, magnitudes, signatures, profiles, target.size
    )


def _whitened(values: np.ndarray, whiteners: Sequence[np.ndarray]) -> np.ndarray:
    """``(R, G, F)`` to ``(G, R * F)``."""
    rows = [v @ w.T for v, w in zip(values, whiteners, strict=True)]
    return np.concatenate(rows, axis=1)


def _between(points: np.ndarray, magnitudes: np.ndarray, at: float) -> np.ndarray:
    after = int(np.clip(np.searchsorted(magnitudes, at), 1, len(magnitudes) - 1))
    low, high = magnitudes[after - 1], magnitudes[after]
    share = (at - low) / (high - low)
    return points[after - 1] + share * (points[after] - points[after - 1])


def refined(
    runs: Runs,
    nominal: Nominal,
    scores: Scores,
    candidates: Mapping[str, Row],
    whiteners: Sequence[np.ndarray],
    *,
    best: int = 4,
) -> Scores:
    """Simulate again around the best magnitudes of the best candidates.

    The coarse curve's cost is that of a straight line between two simulations; here it
    becomes that of a short one.

    Args:
        runs: recorded runs.
        nominal: simulation without effects.
        scores: of the coarse curves.
        candidates: explanations by name.
        whiteners: one matrix of each run.
        best: number of candidates that are simulated again.
    """
    residuals = servo_curves.residuals(runs, nominal)
    top = scores.ranked[:best]
    near = {name: _near(candidates[name], scores.magnitudes[name]) for name in top}
    fine = servo_curves.curves(runs, nominal, [candidates[n] for n in top], near)
    found = score(residuals, fine, whiteners)
    return replace(
        scores,
        costs={**scores.costs, **found.costs},
        magnitudes={**scores.magnitudes, **found.magnitudes},
        signatures={**scores.signatures, **found.signatures},
        profiles={**scores.profiles, **found.profiles},
    )


def _near(candidate: Row, at: float) -> np.ndarray:
    grid = np.unique([*candidate.levels, candidate.nominal])
    after = int(np.clip(np.searchsorted(grid, at), 1, len(grid) - 1))
    low, high = grid[after - 1], grid[after]
    made = at * (high / low) ** FINE if ratio(candidate) else at + (high - low) * FINE
    return np.clip(made, candidate.low, candidate.high)


def whiteners(
    runs: Runs, discrepancy: Discrepancy, without: Sequence[object] = ()
) -> list[np.ndarray]:
    """One whitening matrix per run, by its trajectory and told gain.

    Args:
        runs: R recorded runs.
        discrepancy: what the nominal model leaves by itself.
        without: as of `Discrepancy.whitener`.

    Returns:
        R matrices, each for the residuals of one run.
    """
    told = zip(runs.labels["trajectory"], runs.told["gain"], strict=True)
    return [discrepancy.whitener(kind, gain, without=without) for kind, gain in told]
