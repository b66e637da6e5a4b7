"""Picture of the standings: what is deployed over the trials after the damage."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bns.standings import figures
from bns.standings.design import PRIORS
from bns.standings.figures import Cell
from bns.storage import files
from bns.viz import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
        panels = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
        for axes, ((_, prior, kind), held) in zip(panels, groups.items(), strict=True):
            for name, some in figures.by_rival(held).items():
                over = np.mean([_shares(cell) for cell in some], axis=0)
                runs = min(cell.runs for cell in some)
                trials = np.arange(1, len(over) + 1)
                said = f"{name} (n = {runs} x {len(some)})"
                axes.plot(trials, over, color=colours[name], label=said)
            axes.set_title(f"{prior}: {PRIORS[prior]}\n({kind})", fontsize="small")
            axes.set_xlabel("trial from the damage on")
            axes.set_ylim(bottom=0)
            axes.legend(fontsize="x-small")
        panels[0].set_ylabel("deployed: share of the ceiling (or solved)")
    return figure


def _shares(cell: Cell) -> np.ndarray:
    """Mean over runs, ``(T,)``; metres where the ceiling is not known."""
    top = cell.ceiling if np.isfinite(cell.ceiling) else 1.0
    found: np.ndarray = cell.deployed.mean(0) / top
    return found
