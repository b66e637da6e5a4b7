"""How well a recording tells the magnitudes of a fit."""

import numpy as np

from bns.gap.fit import Point
from bns.gap.verdict import Calibration

LEVEL = 1.6449  # 90 % interval


def intervals(
    point: Point, rules: Calibration
) -> tuple[tuple[tuple[float, float], ...], float]:
    """90 % interval of each magnitude; condition of the fit."""
    deviations, condition = spreads(point)
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


def spreads(point: Point) -> tuple[tuple[float, ...], float]:
    """Standard deviation of each magnitude from the slopes; condition of the fit."""
    if not point.terms or not len(point.slopes):
        return (0.0,) * len(point.terms), 1.0
    size = np.linalg.norm(point.slopes, axis=1) + 1e-12
    scaled = point.slopes / size[:, None]
    normal = scaled @ scaled.T
    condition = float(np.linalg.cond(normal))
    spread = np.sqrt(np.abs(np.diag(np.linalg.pinv(normal)))) / size
    widths = [1 + len(term.extras) for term in point.terms]
    places = np.cumsum([0, *widths[:-1]])
    return tuple(spread[places].tolist()), condition
