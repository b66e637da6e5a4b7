"""Figures of runs: each a function that returns a matplotlib Figure.

Figures over trials take a mapping from label to `RunRecord`, so that runs can be
laid over one another; figures of one run take its record.
"""

from bns.viz.figures.light import light_responses, readings, starts
from bns.viz.figures.motion import displacement, path
from bns.viz.figures.trials import curves, fitness, solved, waits

__all__ = [
    "curves",
    "displacement",
    "fitness",
    "light_responses",
    "path",
    "readings",
    "solved",
    "starts",
    "waits",
]
