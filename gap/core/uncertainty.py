"""How well a recording tells the magnitudes of a fit."""

import numpy as np

from bns.gap.core import conformal
from bns.gap.core.fit import Point
from bns.gap.core.problem import Problem
from bns.gap.core.signatures import levels_of
from bns.gap.core.verdict import Calibration

LEVEL = 1.6449  # 90 % interval
FLAT = 1e-9  # of a slope: a whole magnitude (a leg is there or not) has none


def intervals(
    problem: Problem, point: Point, rules: Calibration
) -> tuple[tuple[tuple[float, float], ...], float]:
    """90 % interval of each magnitude; condition of the fit.

    Args:
        problem: the recording.
        point: a fitted support.
        rules: widths of intervals.
    """
    deviations, condition = spreads(problem, point)
    spans = []
    for term, deviation in zip(point.terms, deviations, strict=True):
        item = term.candidate
        error = standard_error(deviation, term.magnitude - item.nominal, rules)
        half = half_width(error, item.effect, item.unit, rules)
        low = max(term.magnitude - half, item.low)
        spans.append((low, min(term.magnitude + half, item.high)))
    return tuple(spans), condition


def standard_error(deviation: float, departure: float, rules: Calibration) -> float:
    """Of a magnitude, with what the nominal model alone puts it off.

    Args:
        deviation: of it by the noise of the recording.
        departure: of it from the nominal value.
        rules: how far off the nominal model is.
    """
    return float(np.hypot(deviation, rules.model_error * departure))


def half_width(error: float, effect: str, unit: str, rules: Calibration) -> float:
    """Half the interval of a magnitude that holds as often as the rules say.

    Args:
        error: standard error.
        effect: name in the registry.
        unit: of the magnitude.
        rules: the coverage, and a further factor on all intervals.
    """
    return rules.widen * conformal.reach(effect, unit, rules.coverage) * error


def spreads(problem: Problem, point: Point) -> tuple[tuple[float, ...], float]:
    """Standard deviation of each magnitude; condition of the fit.

    From the slopes; where the motion changes in steps, from the step's width.
    """
    if not point.terms or not len(point.slopes):
        return (0.0,) * len(point.terms), 1.0
    size = np.linalg.norm(point.slopes, axis=1) + 1e-12
    scaled = point.slopes / size[:, None]
    normal = scaled @ scaled.T
    sloping = size > FLAT
    part = normal[np.ix_(sloping, sloping)]
    condition = float(np.linalg.cond(part)) if len(part) else 1.0
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
