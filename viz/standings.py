"""Picture of the standings: what is deployed over the trials after the damage."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bns.standings import figures
from bns.standings.design import PRIORS
from bns.standings.figures import Cell
from bns.storage import files
from bns.viz import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WRAPPED = 44
"""letters of a title's line"""


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
    """Mean of all runs and damages, a panel for each prior and set of damages.

    Args:
        cells: of one task.

    Returns:
        A matplotlib figure.
    """
    groups = figures.groups(cells)
    names = list(dict.fromkeys(cell.entry.rival for cell in cells))
    colours = dict(zip(names, [*style.CYCLE] * 3, strict=False))
    with style.plotting() as figure_class:
        width = max(4.0 * len(groups), style.WIDE.width)
        figure = figure_class(figsize=(width, 4.2), layout="constrained")
        panels = figure.subplots(1, len(groups), squeeze=False)[0]
        for axes, (group, held) in zip(panels, groups.items(), strict=True):
            _panel(axes, group, held, colours)
    return figure


def _panel(
    axes: "Axes",
    group: tuple[str, str, str],
    cells: Sequence[Cell],
    colours: Mapping[str, str],
) -> None:
    """One task, prior and set of damages: a line a learner."""
    task, prior, kind = group
    for name, some in figures.by_rival(cells).items():
        known = figures.comparable(some)
        if not known:
            continue
        over = np.mean([c.deployed.mean(0) / top for c, top in known], axis=0)
        trials = np.arange(1, len(over) + 1)
        label = f"{name} (n = {min(c.runs for c, _ in known)} x {len(known)})"
        axes.plot(trials, over, color=colours[name], label=label)
    said = "\n".join(textwrap.wrap(f"{prior}: {PRIORS[prior]}", WRAPPED))
    measure = figures.measure(task, kind)
    axes.set_title(f"{said}\n({kind})", fontsize="small")
    axes.set_ylabel(f"deployed: {measure}")
    axes.set_xlabel("trial from the damage on")
    axes.set_ylim(0, None if measure == "distance [m]" else 1)
    axes.legend(fontsize="x-small")
