"""Scores of candidates on the runs of one servo setting, whitened.

A nominal law is never exact, and its errors are alike from run to run: they are no
white noise. Runs of other settings, told truly, show their covariance (`Discrepancy`);
whitening with it keeps a candidate from explaining what the nominal law always gets
wrong. Settings near in gain count more, as stiff control hides what soft control shows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.errors import BnsError
from bns.gap.decomposition.row import Row
from bns.gap.models.servo import curves as servo_curves
from bns.gap.models.servo.candidates import ratio
from bns.gap.models.servo.curves import Curve
from bns.gap.models.servo.nominal import Nominal
from bns.gap.models.servo.runs import Runs

SHRINK = 0.3  # share of the covariance that is a smooth prior; assumed
MEMORY = 0.2  # [s] correlation time of that prior; assumed
FLOOR = 0.005  # [rad] what is never believed to be better; half the repeats' scatter
FINE = np.linspace(-1, 1, 9)  # magnitudes tried again around the best, in grid steps
WIDTH = 1.0  # natural logarithm of the ratio of gains that count fully; assumed


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Residuals of cells without a change; a cell is one setting of the servo.

    Attributes:
        residuals: by trajectory, shape ``(cells, F)`` [rad]; NaN where a cell has no
            such run. Repeats are averaged.
        gains: of the cells, shape ``(cells,)``.
        cells: names of the cells.
        step: time between features [s].
    """

    residuals: dict[str, np.ndarray]
    gains: np.ndarray
    cells: tuple
    step: float

    def whitener(
        self, trajectory: str, gain: float, *, without: Sequence[object] = ()
    ) -> np.ndarray:
        """Matrix that whitens the residual of a run, shape ``(F, F)``.

        Args:
            trajectory: what the run was told to do.
            gain: that the run was told to have.
            without: cells to leave out (the run's own).

        Raises:
            BnsError: fewer than three other cells have this trajectory.
        """
        rows = self.residuals.get(trajectory)
        if rows is None:
            raise BnsError(
                f"No run without a change has the trajectory {trajectory!r}."
            )
        left_out = np.array([cell in without for cell in self.cells])
        use = ~left_out & np.isfinite(rows).all(axis=1)
        if use.sum() < 3:
            raise BnsError(
                f"{use.sum()} settings without a change have the trajectory "
                f"{trajectory!r}; a covariance needs 3 at least."
            )
        away = np.log(self.gains[use]) - np.log(gain)
        weight = np.exp(-0.5 * (away / WIDTH) ** 2)
        weighted = rows[use] * np.sqrt(weight / weight.sum())[:, None]
        return _whitener(weighted.T @ weighted, self.step)


def _whitener(covariance: np.ndarray, step: float) -> np.ndarray:
    size = len(covariance)
    deviation = np.sqrt(np.diag(covariance))
    apart = np.abs(np.subtract.outer(np.arange(size), np.arange(size))) * step
    smooth = np.outer(deviation, deviation) * np.exp(-apart / MEMORY)
    whole = (1 - SHRINK) * covariance + SHRINK * smooth + FLOOR**2 * np.eye(size)
    return np.linalg.inv(np.linalg.cholesky(whole))


def learn(
    residuals: np.ndarray,
    cells: Sequence[tuple[float, ...]],
    trajectories: Sequence[str],
    *,
    step: float,
) -> Discrepancy:
    """Gather residuals of merged runs by cell and trajectory.

    Args:
        residuals: recorded minus nominal features, shape ``(R, F)`` [rad].
        cells: setting of each run; its last entry is the gain.
        trajectories: of each run.
        step: time between features [s].
    """
    names = tuple(dict.fromkeys(cells))
    table = {
        kind: np.full((len(names), residuals.shape[1]), np.nan)
        for kind in dict.fromkeys(trajectories)
    }
    for row, cell, kind in zip(residuals, cells, trajectories, strict=True):
        table[kind][names.index(cell)] = row
    gains = np.array([cell[-1] for cell in names])
    return Discrepancy(table, gains, names, step)


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
