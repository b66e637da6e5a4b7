"""Fitness over trials."""

from collections.abc import Mapping

from bns.experiment.record import RunRecord
from bns.viz import style
from bns.viz.figures import bands
from bns.viz.scene import walks


def fitness(runs: Mapping[str, RunRecord]):
    """Fitness in the world of the controller tried, over trials, logarithmic.

    Line: median over replicates; band: their middle half; dotted: mean. Each
    objective that was missed costs the task's penalty, so the plateaus are counts of
    objectives.
    """
    if any(walks(record.config) for record in runs.values()):
        return distance(runs)
    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        axes = figure.subplots()
        for label, record, colour in bands.coloured(runs):
            bands.band(axes, record["fitness"], colour, label, mean=True)
        axes.set_yscale("log")
        _steps(axes, next(iter(runs.values())))
        bands.mark_damage(axes, runs)
        bands.finish(axes, runs)
        axes.set_ylabel("fitness (lower is better)")
        axes.set_title("Fitness in the world", pad=14)
    return figure


def distance(runs: Mapping[str, RunRecord]):
    """How far the controllers tried walked, over trials; an adequate gait is dotted."""
    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        axes = figure.subplots()
        for label, record, colour in bands.coloured(runs):
            bands.band(axes, record["distance"], colour, label)
        enough = next(iter(runs.values())).config.walk.adequate
        axes.axhline(enough, color=style.GREY, linewidth=0.8, ls=(0, (1, 3)))
        axes.set_ylim(bottom=0)
        bands.mark_damage(axes, runs)
        bands.finish(axes, runs)
        axes.set_ylabel("distance [m] (higher is better)")
        axes.set_title("Distance walked in the world", pad=14)
    return figure


def _steps(axes, record: RunRecord) -> None:
    """Lines at the cost of one and of all objectives missed."""
    from bns.viz.scene import follows_light, order

    if follows_light(record.config):
        return
    penalty, count = record.config.task.penalty, len(order(record.config))
    if penalty <= 0:
        return
    for missed in (1, count):
        axes.axhline(missed * penalty, color=style.GREY, linewidth=0.8, ls=(0, (1, 3)))
        axes.annotate(
            f"{missed} missed" if missed < count else f"all {count} missed",
            (1.0, missed * penalty),
            xycoords=("axes fraction", "data"),
            xytext=(-3, 2),
            textcoords="offset points",
            ha="right",
            color=style.GREY,
            fontsize=8,
        )
