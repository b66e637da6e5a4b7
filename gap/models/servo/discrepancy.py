"""How a nominal servo law errs by itself, learned from runs in which nothing changed.

A nominal law is never exact, and its errors are alike from run to run: they are no
white noise. Runs of other settings, told truly, show their covariance; whitening with
it keeps a candidate from explaining what the nominal law always gets wrong. Settings
near in gain count more, as stiff control hides what soft control shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bns.errors import BnsError

SHRINK = 0.3  # share of the covariance that is a smooth prior; assumed
MEMORY = 0.2  # [s] correlation time of that prior; assumed
FLOOR = 0.005  # [rad] what is never believed to be better; half the repeats' scatter
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
