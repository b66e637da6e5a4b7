"""How well runs do over trials, by the figure that the task names."""

from collections.abc import Mapping

from bns.experiment.record import RunRecord
from bns.tasks import Curve
from bns.viz import style
from bns.viz.figures import bands
from bns.viz.scene import picture


def fitness(runs: Mapping[str, RunRecord]):
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
        for label, record, colour in bands.coloured(runs):
            values = record[shown.column]
            bands.band(axes, values, colour, label, mean=shown.log)
        if shown.log:
            axes.set_yscale("log")
        for value, text in shown.marks:
            _mark(axes, value, text)
        if not shown.log:
            axes.set_ylim(bottom=0)
        bands.mark_damage(axes, runs)
        bands.finish(axes, runs)
        axes.set_ylabel(shown.label)
        axes.set_title(shown.title, pad=14)
    return figure


def _mark(axes, value: float, text: str) -> None:
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
