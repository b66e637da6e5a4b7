"""Diversity of the population over trials."""

from collections.abc import Mapping

from bns.experiment.record import RunRecord
from bns.viz import style
from bns.viz.figures import bands

MEASURES = {
    "diversity_41": "equation 4.1",
    "diversity_51": "equation 5.1",
    "diversity_73": "equation 7.3",
}
"""Column: where the dissertation defines it."""


def diversity(runs: Mapping[str, RunRecord]):
    """The three diversity measures of the dissertation, over trials."""
    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        panels = figure.subplots(1, len(MEASURES))
        for axes, (column, title) in zip(panels, MEASURES.items(), strict=True):
            for label, record, colour in bands.coloured(runs):
                bands.band(axes, record[column], colour, label)
            axes.set_title(title, pad=14)
            axes.set_ylim(bottom=0)
            axes.ticklabel_format(axis="y", scilimits=(-2, 3), useMathText=True)
            axes.yaxis.get_offset_text().set_visible(True)
            bands.mark_damage(axes, runs, text=False)
            bands.finish(axes, runs, legend=axes is panels[-1])
        panels[0].set_ylabel("diversity of the population")
    return figure
