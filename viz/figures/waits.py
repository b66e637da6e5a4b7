"""How many trials runs needed, as empirical distributions."""

from collections.abc import Mapping

import numpy as np

from bns import stats
from bns.experiment.record import RunRecord
from bns.viz import facts, style
from bns.viz.figures import bands


def waits(runs: Mapping[str, RunRecord]):
    """Share of runs that had solved (left) or recovered (right) after so many trials.

    A curve that ends below 100 % tells of runs that never did.
    """
    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        damaged = bool(bands.onsets(runs))
        panels = figure.subplots(1, 1 + damaged, squeeze=False, sharey=True)[0]
        for label, record, colour in bands.coloured(runs):
            start = int(record.damage_onset.min()) if damaged else record.trials
            start = start if 0 <= start <= record.trials else record.trials
            _steps(panels[0], facts.to_solve(record), start, colour, label)
            if damaged:
                back, left = stats.trials_to_recover(record), record.trials - start
                _steps(panels[1], back, left, colour, label)
        titles = ("Solved for the first time", "Recovered from the damage")
        units = ("trials from the start", "trials from the damage")
        for axes, title, unit in zip(panels, titles, units, strict=False):
            axes.set_title(title)
            axes.set_xlabel(unit)
            axes.set_ylim(-3, 103)
            axes.set_xlim(left=0)
            axes.xaxis.get_major_locator().set_params(integer=True)
        panels[0].set_ylabel("% of runs")
        if len(runs) > 1:
            panels[-1].legend(loc="lower right")
    return figure


def _steps(axes, counts: np.ndarray, longest: int, colour: str, label: str) -> None:
    counts = counts[~np.isnan(counts)]
    finite = np.sort(counts[np.isfinite(counts)])
    x = np.concatenate([[0.0], finite, [longest]])
    share = np.arange(len(finite) + 1) / max(len(counts), 1)
    y = 100 * np.append(share, share[-1])
    axes.step(x, y, where="post", color=colour, label=label)
    if 2 * len(finite) >= len(counts) > 0:
        median = finite[(len(counts) + 1) // 2 - 1]
        axes.plot([median, median], [0, 50], color=colour, linewidth=0.9, ls=":")
