"""Picture of the standings: what is deployed over the trials after the damage."""

import itertools
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.standings import figures
from bns.standings.design import PRIORS
from bns.standings.figures import Cell
from bns.storage import files
from bns.viz import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WRAPPED = 36
"""letters of a title's line"""
LINES = "-", "--", ":"
"""of the first seven learners, of the next, and so on"""


def write(cells: Sequence[Cell], folder: Path) -> list[Path]:
    """Write a picture for each task, ``standings-TASK.png``; gives the files.

    Args:
        cells: of any tasks.
        folder: where to; made if it is not there.

    Raises:
        StorageError: no space, or no permission.
    """
    files.make_directory(folder)
    made = []
    for task in dict.fromkeys(cell.entry.task for cell in cells):
        path = folder / f"standings-{task}.png"
        some = [cell for cell in cells if cell.entry.task == task]
        figure = curves(some)
        with style.plotting():
            style.fit(figure)
            files.replace(path, figure.savefig)
        made.append(path)
    return made


def curves(cells: Sequence[Cell]) -> "Figure":
    """Mean of all runs and damages: a column for each prior, a row for each set.

    Args:
        cells: of one task.

    Returns:
        A matplotlib figure.
    """
    groups = figures.groups(cells)
    names = list(dict.fromkeys(cell.entry.rival for cell in cells))
    looks = {
        name: {"color": colour, "linestyle": line}
        for name, (line, colour) in zip(
            names, itertools.product(LINES, style.CYCLE), strict=False
        )
    }
    priors = list(dict.fromkeys(prior for _, prior, _ in groups))
    kinds = list(dict.fromkeys(kind for *_, kind in groups))
    with style.plotting() as figure_class:
        size = (max(3.2 * len(priors), style.WIDE.width), 3.4 * len(kinds))
        figure = figure_class(figsize=size, layout="constrained")
        panels = figure.subplots(
            len(kinds), len(priors), sharex=True, sharey="row", squeeze=False
        )
        for axes in panels.flat:
            axes.set_visible(False)
        for (task, prior, kind), held in groups.items():
            axes = panels[kinds.index(kind)][priors.index(prior)]
            axes.set_visible(True)
            _panel(axes, (task, prior, kind), held, looks)
        lines = {
            line.get_label(): line for axes in panels.flat for line in axes.get_lines()
        }
        figure.legend(
            [lines[name] for name in names if name in lines],
            [name for name in names if name in lines],
            loc="outside lower center",
            ncols=4,
        )
    return figure


def _panel(
    axes: "Axes",
    group: tuple[str, str, str],
    cells: Sequence[Cell],
    looks: Mapping[str, Mapping[str, Any]],
) -> None:
    """One task, prior and set of damages: a line a learner."""
    task, prior, kind = group
    counts = set()
    for name, some in figures.by_rival(cells).items():
        known = figures.comparable(some)
        if not known:
            continue
        over = np.mean([c.deployed.mean(0) / top for c, top in known], axis=0)
        trials = np.arange(1, len(over) + 1)
        counts.add((min(c.runs for c, _ in known), len(known)))
        axes.plot(trials, over, **looks[name], label=name)
    said = "\n".join(textwrap.wrap(f"{prior}: {PRIORS[prior]}", WRAPPED))
    measure = figures.measure(task, kind)
    least = "at least " if len(counts) > 1 else ""
    runs, damages = min(counts, default=(0, 0))
    held = f"damages {kind}: {least}{runs} runs of each of {damages}"
    axes.set_title(f"{said}\n{held}", fontsize="small")
    axes.set_ylabel(f"deployed: {measure}", fontsize="small")
    axes.tick_params(labelbottom=True)
    axes.set_xlabel("trial from the damage on")
    if measure != "distance [m]":
        axes.set_ylim(0, 1.02)
    axes.set_ylim(bottom=0)
