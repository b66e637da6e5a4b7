"""Objectives reached and share of runs that solve, over trials."""

from collections.abc import Mapping

from bns.experiment.record import RunRecord
from bns.viz import style
from bns.viz.figures import bands
from bns.viz.scene import picture


def solved(runs: Mapping[str, RunRecord]):
    """Left: objectives reached (median, middle half). Right: share of runs solving.

    Dotted: of the controllers deployed, where a learner deploys one apart from what it
    tries.
    """
    shown = [picture(record.config) for record in runs.values()]

    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        left, right = figure.subplots(1, 2)
        for label, record, colour in bands.coloured(runs):
            bands.band(left, record["reached"], colour, label)
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
            bands.mark_damage(axes, runs)
            bands.finish(axes, runs, legend=axes is right)
    return figure
