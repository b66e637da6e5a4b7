"""Three simpler ways to name an effect, to be compared with."""

import numpy as np

from bns.gap.core.problem import Problem
from bns.gap.core.signatures import Curves

RIDGE = 1e-2
FOLDS = 4


def name(problem: Problem, curves: Curves) -> dict[str, str]:
    """The effect that each baseline names; "" = none.

    All work on the same signatures, without the covariance of the noise: the
    whitening is undone to one scale per feature channel.
    """
    rest, rows, trial = _plain(problem, curves)
    return {
        "iid": _iid(rest, rows, curves),
        "largest": _largest(rest, rows, curves),
        "forward": _forward(rest, rows, curves, trial),
    }


def _plain(problem: Problem, curves: Curves):
    """Residual and signatures in units of each channel's spread, trial of each row."""
    channels = len(problem.model.features)
    factors = problem.whiten.factors
    rows_of = problem.whiten.rows

    def undo(z: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [
                (factor @ z[..., rows].T).T
                for factor, rows in zip(factors, rows_of, strict=True)
            ],
            axis=-1,
        )

    rest = undo(problem.rest[None])[0]
    scale = np.tile(rest.reshape(-1, channels).std(axis=0), len(rest) // channels)
    trial = np.concatenate(
        [np.full(rows.stop - rows.start, n) for n, rows in enumerate(rows_of)]
    )
    return rest / scale, undo(curves.signature.astype(float)) / scale, trial


def _iid(rest, rows, curves: Curves) -> str:
    """Least squares, errors independent: the smallest sum of squares."""
    square = ((rest - rows) ** 2).sum(axis=1)
    return curves.candidates[curves.owner[square.argmin()]].name


def _first(rows, curves: Curves) -> np.ndarray:
    """The smallest level of each candidate, as its linear signature."""
    size = (rows**2).sum(axis=1)
    chosen = []
    for number in range(len(curves.candidates)):
        mine = curves.levels(number)
        strong = mine[size[mine] > 1e-6 * size.max()]
        chosen.append(strong[size[strong].argmin()] if len(strong) else mine[0])
    return np.array(chosen)


def _largest(rest, rows, curves: Curves) -> str:
    """Fit all effects at once; the one that changes the motion most."""
    slopes = rows[_first(rows, curves)]
    length = np.linalg.norm(slopes, axis=1) + 1e-12
    unit = slopes / length[:, None]
    normal = unit @ unit.T + RIDGE * np.eye(len(unit))
    weights = np.linalg.solve(normal, unit @ rest)
    return curves.candidates[int(np.abs(weights).argmax())].name


def _forward(rest, rows, curves: Curves, trial: np.ndarray) -> str:
    """Forward selection by cross-validation, nothing first, one standard error."""
    slopes = rows[_first(rows, curves)]
    folds = trial % FOLDS
    base = np.array([(rest[folds == k] ** 2).sum() for k in range(FOLDS)])
    best, chosen = base, ""
    for number, slope in enumerate(slopes):
        score = []
        for fold in range(FOLDS):
            kept = folds != fold
            weight = slope[kept] @ rest[kept] / (slope[kept] @ slope[kept] + 1e-12)
            score.append(((rest - weight * slope)[~kept] ** 2).sum())
        score = np.array(score)
        if score.sum() < best.sum():
            best, chosen = score, curves.candidates[number].name
    error = (base - best).std(ddof=1) * np.sqrt(FOLDS)
    return chosen if base.sum() - best.sum() > error else ""
