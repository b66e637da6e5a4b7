"""How well a recording tells the magnitudes of a fit."""

import numpy as np

from bns.gap.fit import Point
from bns.gap.problem import Problem
from bns.gap.signatures import levels_of
from bns.gap.verdict import Calibration

LEVEL = 1.6449  # 90 % interval


def intervals(
    problem: Problem, point: Point, rules: Calibration
) -> tuple[tuple[tuple[float, float], ...], float]:
    """90 % interval of each magnitude; condition of the fit."""
    deviations, condition = spreads(problem, point)
    spans = []
    for term, deviation in zip(point.terms, deviations, strict=True):
        item = term.candidate
        half = half_width(deviation, term.magnitude - item.nominal, rules)
        low = max(term.magnitude - half, item.low)
        spans.append((low, min(term.magnitude + half, item.high)))
    return tuple(spans), condition


def half_width(deviation: float, departure: float, rules: Calibration) -> float:
    """Half the 90 % interval of a magnitude.

    Args:
        deviation: of it by the noise of the recording.
        departure: of it from the nominal value.
        rules: how far off the nominal model is, and the conformal factor.
    """
    return (
        LEVEL * rules.widen * float(np.hypot(deviation, rules.model_error * departure))
    )


def spreads(problem: Problem, point: Point) -> tuple[tuple[float, ...], float]:
    """Standard deviation of each magnitude; condition of the fit.

    From the slopes; where the motion changes in steps, from the step's width.
    """
    if not point.terms or not len(point.slopes):
        return (0.0,) * len(point.terms), 1.0
    size = np.linalg.norm(point.slopes, axis=1) + 1e-12
    scaled = point.slopes / size[:, None]
    normal = scaled @ scaled.T
    condition = float(np.linalg.cond(normal))
    spread = np.sqrt(np.abs(np.diag(np.linalg.pinv(normal)))) / size
    widths = [1 + len(term.extras) for term in point.terms]
    places = np.cumsum([0, *widths[:-1]])
    found = spread[places].tolist()
    for place, term in enumerate(point.terms):
        steps = np.array(levels_of(problem, term.candidate))
        if term.candidate.stepped and len(steps) > 1:
            at = int(np.abs(steps - term.magnitude).argmin())
            near = steps[max(at - 1, 0) : at + 2]
            found[place] = float(np.ptp(near)) / (len(near) - 1) / LEVEL
    return tuple(found), condition
