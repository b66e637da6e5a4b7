"""A learner's own columns over trials, as it declares them."""

from collections.abc import Mapping

from bns.experiment.record import RunRecord
from bns.learners.base import Curves
from bns.viz import style
from bns.viz.figures import bands


def curves(runs: Mapping[str, RunRecord], shown: Curves):
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
            for label, record, colour in bands.coloured(runs):
                values = record[panel.column] * panel.factor
                bands.band(axes, values, colour, label)
            if shown.log:
                axes.set_yscale("log")
            axes.set_title(panel.title, pad=14)
            if not shown.log:
                axes.set_ylim(bottom=0)
                axes.ticklabel_format(axis="y", scilimits=(-2, 3), useMathText=True)
                axes.yaxis.get_offset_text().set_visible(True)
            bands.mark_damage(axes, runs, text=False)
            bands.finish(axes, runs, legend=axes is panels[-1])
        panels[0].set_ylabel(shown.label)
    return figure
