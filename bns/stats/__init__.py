"""Statistics of runs: tests, effect sizes, intervals, milestones, comparisons."""

from bns.stats.measures import (
    CONFIDENCE,
    Interval,
    a12,
    a12_error,
    a12_value,
    holm,
    mann_whitney,
    median,
    median_interval,
    observation_after,
    p_of_u,
    trials_to_recover,
    trials_to_solve,
)

__all__ = [
    "CONFIDENCE",
    "Interval",
    "a12",
    "a12_error",
    "a12_value",
    "holm",
    "mann_whitney",
    "median",
    "median_interval",
    "observation_after",
    "p_of_u",
    "trials_to_recover",
    "trials_to_solve",
]
