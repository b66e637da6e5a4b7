"""What the light sensors read, and what their networks foresaw."""

import numpy as np

from bns.experiment.record import RunRecord
from bns.viz import style
from bns.viz.choices import choose, typical

SIDES = ("left", "right")


def readings(record: RunRecord, *, replicate: int | None = None):
    """Readings of chosen trials of one replicate, a column each.

    Args:
        record: the batch, of light following.
        replicate: which run; by default the typical one.
    """
    replicate = typical(record) if replicate is None else replicate
    chosen = choose(record, replicate)
    real = record.extra["readings"][replicate]
    foreseen = np.full_like(real, np.nan)
    if "readings_predicted" in record.extra:
        foreseen = record.extra["readings_predicted"][replicate]
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(7.0, 3.6), layout="constrained")
        panels = figure.subplots(
            len(SIDES), len(chosen), squeeze=False, sharex=True, sharey=True
        )
        for column, choice in enumerate(chosen):
            sent = record.sent[replicate, choice.trial, :, 2]
            times = np.concatenate([[0.0], np.cumsum(sent)])
            for row, side in enumerate(SIDES):
                axes = panels[row, column]
                axes.plot(
                    times,
                    foreseen[choice.trial, :, row],
                    color=style.BLACK,
                    linewidth=1.0,
                    ls=(0, (3, 2)),
                    label="as the SNN foresaw it",
                )
                axes.plot(
                    times,
                    real[choice.trial, :, row],
                    color=choice.colour,
                    label="as the sensor read",
                )
                panels[row, 0].set_ylabel(f"{side} [counts]")
            panels[-1, column].set_xlabel("time [s]")
            title = f"trial {choice.trial}\n{choice.label}"
            panels[0, column].set_title(title, color=choice.colour)
        handles, labels = panels[0, -1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure
