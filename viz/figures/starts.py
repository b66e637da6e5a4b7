"""Paths of the last trials of a run, each from its own start."""

import numpy as np

from bns.experiment.record import RunRecord
from bns.tasks.base import BOARD
from bns.viz import scene, style
from bns.viz.choices import typical
from bns.viz.paths import listed

LAST = 12
"""trials shown"""


def starts(record: RunRecord, *, replicate: int | None = None):
    """Where the robot went in the last trials, by start.

    Args:
        record: the batch, of light following.
        replicate: which run; by default the typical one.
    """
    from matplotlib.patches import Circle

    replicate = typical(record) if replicate is None else replicate
    shown = range(max(0, record.trials - LAST), record.trials)
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(7.0, 4.9), layout="constrained")
        axes = figure.subplots()
        shown_task = scene.picture(record.config)
        for x, y in shown_task.objectives.values():
            ring = {"fill": False, "color": style.YELLOW, "linewidth": 3.0}
            axes.add_patch(Circle((x, y), shown_task.radius, **ring))
            axes.plot(x, y, "*", color=style.YELLOW, markersize=14)
        for number, trial in enumerate(shown):
            poses = listed(record.poses[replicate, trial])
            share = number / max(len(shown) - 1, 1)
            colour = style.SKY if record["solved"][replicate, trial] else style.ORANGE
            axes.plot(*poses[:, :2].T, color=colour, alpha=0.35 + 0.65 * share, lw=1.2)
            axes.plot(*poses[0, :2], "o", color=style.BLACK, markersize=4)
            if record["lamp_stops"][replicate, trial] > 0:
                axes.plot(*poses[-1, :2], "x", color=style.BLACK, markersize=7)
        half = np.array(BOARD)
        axes.set_xlim(-half[0], half[0])
        axes.set_ylim(-half[1], half[1])
        axes.set_aspect("equal", "box")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        solved = int(record["solved"][replicate, list(shown)].sum())
        axes.set_title(
            f"trials {shown[0]} to {shown[-1]}: {solved} of {len(shown)} circled the "
            "lamp (blue)"
        )
    return figure
