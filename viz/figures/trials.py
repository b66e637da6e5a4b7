"""Figures over trials: what runs reach, how long they need, their own columns."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from bns import stats
from bns.experiment.record import RunRecord
from bns.learners.base import Curves
from bns.tasks import Curve
from bns.viz import facts, style
from bns.viz.scene import picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


SPREAD = (25, 75)
"""Percentiles between which the band lies."""


def band(
    axes: "Axes", values: np.ndarray, colour: str, label: str, *, mean: bool = False
) -> None:
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
    alone: Any = {"marker": "o", "markersize": 4} if len(trial) == 1 else {}
    axes.plot(trial, middle, color=colour, label=label, **alone)
    if mean:
        average = np.nanmean(values, axis=0)
        axes.plot(trial, average, color=colour, linewidth=1.0, ls=":")


def mark_damage(
    axes: "Axes", runs: Mapping[str, RunRecord], *, text: bool = True
) -> None:
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


def finish(axes: "Axes", runs: Mapping[str, RunRecord], *, legend: bool = True) -> None:
    """Limits, label of the trial axis, legend where several runs are shown.

    Args:
        axes: Matplotlib's.
        runs: name -> record, as drawn in them.
        legend: whether there is one.
    """
    longest = max(record.trials for record in runs.values())
    axes.set_xlim(-0.5, max(longest - 0.5, 0.5))
    axes.set_xlabel("trial in the world")
    ticks: Any = axes.xaxis.get_major_locator()
    ticks.set_params(integer=True)
    if legend and len(runs) > 1:
        axes.legend(loc="best")


def coloured(runs: Mapping[str, RunRecord]) -> Iterator[Any]:
    """(label, record, colour) of each run."""
    for number, (label, record) in enumerate(runs.items()):
        yield label, record, style.CYCLE[number % len(style.CYCLE)]


def fitness(runs: Mapping[str, RunRecord]) -> "Figure":
    """The task's curve (`Curve`) of the controllers tried, over trials.

    Line: median over replicates; band: their middle half; dotted: mean, where the axis
    is logarithmic. Batches of several tasks are drawn by their fitness.
    """
    curves = {picture(record.config).curve.column for record in runs.values()}
    shown = picture(next(iter(runs.values())).config).curve
    if len(curves) > 1:
        shown = Curve()
    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        axes = figure.subplots()
        for label, record, colour in coloured(runs):
            values = record[shown.column]
            band(axes, values, colour, label, mean=shown.log)
        if shown.log:
            axes.set_yscale("log")
        for value, text in shown.marks:
            _mark(axes, value, text)
        if not shown.log:
            axes.set_ylim(bottom=0)
        mark_damage(axes, runs)
        finish(axes, runs)
        axes.set_ylabel(shown.label)
        axes.set_title(shown.title, pad=14)
    return figure


def _mark(axes: "Axes", value: float, text: str) -> None:
    """A dotted line, and what it says."""
    axes.axhline(value, color=style.GREY, linewidth=0.8, ls=(0, (1, 3)))
    if text:
        axes.annotate(
            text,
            (1.0, value),
            xycoords=("axes fraction", "data"),
            xytext=(-3, 2),
            textcoords="offset points",
            ha="right",
            color=style.GREY,
            fontsize=8,
        )


def solved(runs: Mapping[str, RunRecord]) -> "Figure":
    """Left: objectives reached (median, middle half). Right: share of runs solving.

    Dotted: of the controllers deployed, where a learner deploys one apart from what it
    tries.
    """
    shown = [picture(record.config) for record in runs.values()]

    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        left, right = figure.subplots(1, 2)
        for label, record, colour in coloured(runs):
            band(left, record["reached"], colour, label)
            share = 100 * record["solved"].mean(axis=0)
            right.plot(share, color=colour, label=label, drawstyle="steps-mid")
            if "solved_best" in record.columns:
                best = 100 * record["solved_best"].mean(axis=0)
                said = f"{label} deployed".strip()
                right.plot(best, ":", color=colour, label=said, drawstyle="steps-mid")
        goals = max(len(one.order) for one in shown)
        left.set_ylim(-0.15, goals + 0.15)
        left.set_yticks(range(goals + 1))
        left.set_title(shown[0].reached, pad=14)
        right.set_ylim(-3, 103)
        right.set_ylabel("% of runs")
        right.set_title("Runs whose trial solved the task", pad=14)
        for axes in (left, right):
            mark_damage(axes, runs)
            finish(axes, runs, legend=axes is right)
    return figure


def waits(runs: Mapping[str, RunRecord]) -> "Figure":
    """Share of runs that had solved (left) or recovered (right) after so many trials.

    A curve that ends below 100 % tells of runs that never did.
    """
    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        damaged = bool(onsets(runs))
        panels = figure.subplots(1, 1 + damaged, squeeze=False, sharey=True)[0]
        for label, record, colour in coloured(runs):
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


def _steps(
    axes: "Axes", counts: np.ndarray, longest: int, colour: str, label: str
) -> None:
    counts = counts[~np.isnan(counts)]
    finite = np.sort(counts[np.isfinite(counts)])
    x = np.concatenate([[0.0], finite, [longest]])
    share = np.arange(len(finite) + 1) / max(len(counts), 1)
    y = 100 * np.append(share, share[-1])
    axes.step(x, y, where="post", color=colour, label=label)
    if 2 * len(finite) >= len(counts) > 0:
        median = finite[(len(counts) + 1) // 2 - 1]
        axes.plot([median, median], [0, 50], color=colour, linewidth=0.9, ls=":")


def curves(runs: Mapping[str, RunRecord], shown: Curves) -> "Figure":
    """A panel for each column: median over replicates, and their middle half.

    Args:
        runs: batches by label; all have the columns.
        shown: which columns, and how.
    """
    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        panels = figure.subplots(1, len(shown.panels), squeeze=False,
                                 sharey=shown.shared)[0]  # fmt: skip
        for axes, panel in zip(panels, shown.panels, strict=True):
            for label, record, colour in coloured(runs):
                values = record[panel.column] * panel.factor
                band(axes, values, colour, label)
            if shown.log:
                style.logarithmic(axes.yaxis, axes.set_yscale)
            axes.set_title(panel.title, pad=14)
            if not shown.log:
                axes.set_ylim(bottom=0)
                axes.ticklabel_format(axis="y", style="plain", useOffset=False)
            mark_damage(axes, runs, text=False)
            finish(axes, runs, legend=axes is panels[-1])
        panels[0].set_ylabel(shown.label)
    return figure
