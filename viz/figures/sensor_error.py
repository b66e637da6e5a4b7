"""Error of the sensor networks over trials."""

from collections.abc import Mapping

from bns.experiment.record import RunRecord
from bns.viz import style
from bns.viz.figures import bands

OUTPUTS = {"sensor_left": "left", "sensor_right": "right"}


def sensor_error(runs: Mapping[str, RunRecord]):
    """RMS error per reading of the two sensor SNNs, before training on it."""
    with style.plotting() as figure_class:
        figure = figure_class(figsize=style.WIDE, layout="constrained")
        panels = figure.subplots(1, len(OUTPUTS), sharey=True)
        for axes, (column, name) in zip(panels, OUTPUTS.items(), strict=True):
            for label, record, colour in bands.coloured(runs):
                bands.band(axes, record[column], colour, label)
            axes.set_yscale("log")
            axes.set_title(f"{name} sensor [counts]", pad=14)
            bands.mark_damage(axes, runs, text=False)
            bands.finish(axes, runs, legend=axes is panels[-1])
        panels[0].set_ylabel("RMS error per reading")
    return figure
