"""What figures over trials have in common."""

from collections.abc import Mapping

import numpy as np

from bns.experiment.record import RunRecord
from bns.viz import style

SPREAD = (25, 75)
"""Percentiles between which the band lies."""


def band(axes, values: np.ndarray, colour: str, label: str, *, mean: bool = False):
    """Median over replicates as a line, the middle half of them as a band.

    Args:
        axes: where to draw.
        values: ``(R, T)``.
        colour: of both.
        label: in the legend.
        mean: draw the mean, too, dotted.
    """
    trial = np.flatnonzero(np.isfinite(values).any(axis=0))
    values = np.where(np.isfinite(values), values, np.nan)[:, trial]
    if not len(trial):
        return
    low, middle, high = np.nanpercentile(values, (SPREAD[0], 50, SPREAD[1]), axis=0)
    axes.fill_between(trial, low, high, color=colour, alpha=0.18, linewidth=0)
    alone = {"marker": "o", "markersize": 4} if len(trial) == 1 else {}
    axes.plot(trial, middle, color=colour, label=label, **alone)
    if mean:
        average = np.nanmean(values, axis=0)
        axes.plot(trial, average, color=colour, linewidth=1.0, ls=":")


def mark_damage(axes, runs: Mapping[str, RunRecord], *, text: bool = True) -> None:
    """A dashed line where damage begins; one if all runs agree.

    Args:
        axes: Matplotlib's.
        runs: name -> record, as drawn in them.
        text: whether to write "damage" beside the line.
    """
    for onset in onsets(runs):
        axes.axvline(onset - 0.5, color=style.DAMAGE, ls="--", linewidth=1.2)
        if text:
            axes.annotate(
                "damage",
                (onset - 0.5, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(3, 2),
                textcoords="offset points",
                color=style.DAMAGE,
                fontsize=8.5,
            )


def onsets(runs: Mapping[str, RunRecord]) -> list[int]:
    """Trials from which any replicate of any run was damaged, each once."""
    return sorted(
        {
            int(onset)
            for record in runs.values()
            for onset in record.damage_onset
            if 0 <= onset < record.trials
        }
    )


def finish(axes, runs: Mapping[str, RunRecord], *, legend: bool = True) -> None:
    """Limits, label of the trial axis, legend where several runs are shown.

    Args:
        axes: Matplotlib's.
        runs: name -> record, as drawn in them.
        legend: whether there is one.
    """
    longest = max(record.trials for record in runs.values())
    axes.set_xlim(-0.5, max(longest - 0.5, 0.5))
    axes.set_xlabel("trial in the world")
    axes.xaxis.get_major_locator().set_params(integer=True)
    if legend and len(runs) > 1:
        axes.legend(loc="best")


def coloured(runs: Mapping[str, RunRecord]):
    """(label, record, colour) of each run."""
    for number, (label, record) in enumerate(runs.items()):
        yield label, record, style.CYCLE[number % len(style.CYCLE)]
