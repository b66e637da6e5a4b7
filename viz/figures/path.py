"""Where the robot went and where its simulator network said it would go."""

from collections.abc import Sequence

import numpy as np

from bns.record import RunRecord
from bns.viz import scene, style
from bns.viz.choices import Choice, choose, typical
from bns.viz.paths import arcs, listed


def path(
    record: RunRecord,
    *,
    replicate: int | None = None,
    choices: Sequence[Choice] | None = None,
):
    """Paths of chosen trials of one replicate, a panel each.

    Args:
        record: the batch.
        replicate: which run; by default the typical one.
        choices: which trials; by default `choices.choose`.
    """
    replicate = typical(record) if replicate is None else replicate
    chosen = choose(record, replicate) if choices is None else choices
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(7.0, 3.4), layout="compressed")
        panels = figure.subplots(
            1, len(chosen), squeeze=False, sharex=True, sharey=True
        )
        for axes, choice in zip(panels[0], chosen, strict=True):
            _objectives(axes, record)
            at = (replicate, choice.trial)
            _paths(axes, record.poses[at], record.predicted[at], choice.colour)
            axes.set_title(f"trial {choice.trial}\n{choice.label}", color=choice.colour)
            axes.set_xlabel("x [m]")
            axes.set_aspect("equal", "box")
        panels[0, 0].set_ylabel("y [m]")
        handles, labels = panels[0, -1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _objectives(axes, record: RunRecord) -> None:
    from matplotlib.patches import Circle

    radius = record.config.task.radius
    for name, (x, y) in scene.objectives(record.config).items():
        axes.add_patch(Circle((x, y), radius, color=style.YELLOW, alpha=0.55, lw=0))
        axes.annotate(name, (x, y), ha="center", va="center", fontweight="bold")


def _paths(axes, real: np.ndarray, predicted: np.ndarray, colour: str) -> None:
    for poses, ls, width, label in (
        (listed(predicted), (0, (3, 2)), 1.3, "as the SNN foresaw it"),
        (listed(real), "-", 2.0, "as the robot drove"),
    ):
        if len(poses) < 2:
            continue
        line = arcs(poses)
        shade = style.BLACK if ls != "-" else colour
        axes.plot(*line[:, :2].T, color=shade, ls=ls, linewidth=width, label=label)
    if len(real):
        axes.plot(*real[0, :2], "o", color=style.BLACK, markersize=5, label="start")
    end = listed(real)
    if len(end):
        axes.plot(
            *end[-1, :2], "s", color=colour, mec=style.BLACK, markersize=5, label="end"
        )
