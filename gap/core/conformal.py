"""Intervals that hold the truth as often as they say, by cases made to find that out.

Split conformal prediction (Vovk, Gammerman and Shafer 2005, section 4.2; Papadopoulos
et al. 2002): on calibration cases the error of a magnitude is taken in units of its
standard error; the quantile of these is how many standard errors an interval needs.
Times are apart from other magnitudes (Mondrian, section 4.5 there): how far the nominal
model's own timing is off is not in a standard error.
"""

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from bns.gap.core.verdict import quantile

TIMING, OTHER = "timing", "other"
CLOCKS = ("clock_drift",)  # effects on time whose parameter is not in seconds


def group(effect: str, unit: str) -> str:
    """Whether a magnitude is about time.

    Args:
        effect: its name in the registry.
        unit: of the magnitude.
    """
    return TIMING if unit == "s" or effect in CLOCKS else OTHER


@cache
def errors() -> Mapping[str, tuple[float, ...]]:
    """By group, absolute errors on calibration cases in standard errors, sorted."""
    text = (files(__package__) / "conformal.json").read_text(encoding="utf-8")
    return {name: tuple(found) for name, found in json.loads(text)["errors"].items()}


def reach(effect: str, unit: str, coverage: float) -> float:
    """How many standard errors half an interval spans.

    Args:
        effect: name in the registry.
        unit: of the magnitude.
        coverage: share of intervals that are to hold the truth.
    """
    return quantile(errors()[group(effect, unit)], coverage)
