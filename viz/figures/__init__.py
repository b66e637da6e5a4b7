"""Figures of runs: one file each, one function each that returns a matplotlib Figure.

Figures over trials take a mapping from label to `RunRecord`, so that runs can be
laid over one another; figures of one run take its record.
"""

from bns.viz.figures.curves import curves
from bns.viz.figures.displacement import displacement
from bns.viz.figures.fitness import fitness
from bns.viz.figures.light_responses import light_responses
from bns.viz.figures.path import path
from bns.viz.figures.readings import readings
from bns.viz.figures.solved import solved
from bns.viz.figures.starts import starts
from bns.viz.figures.waits import waits

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
