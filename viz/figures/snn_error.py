"""Error of the simulator network over trials."""

from collections.abc import Mapping

from bns.experiment.record import RunRecord
from bns.viz import style
from bns.viz.charts import DEGREES, MILLIMETRES
from bns.viz.figures import bands

OUTPUTS = {
    "snn_forward": ("forward", MILLIMETRES, "mm"),
    "snn_left": ("sideways", MILLIMETRES, "mm"),
    "snn_turn": ("turn", DEGREES, "deg"),
}
"""Column: output, factor to the unit shown, unit."""


def snn_error(runs: Mapping[str, RunRecord]):
    """RMS error per command of the SNN's three outputs, before training on it."""
    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        panels = figure.subplots(1, len(OUTPUTS))
        for axes, (column, output) in zip(panels, OUTPUTS.items(), strict=True):
            name, factor, unit = output
            for label, record, colour in bands.coloured(runs):
                bands.band(axes, record[column] * factor, colour, label)
            axes.set_yscale("log")
            axes.set_title(f"{name} [{unit}]", pad=14)
            bands.mark_damage(axes, runs, text=False)
            bands.finish(axes, runs, legend=axes is panels[-1])
        panels[0].set_ylabel("RMS error per command")
    return figure
