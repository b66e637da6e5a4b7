"""What the simulator network foresaw of each command against what happened."""

import numpy as np

from bns.record import RunRecord
from bns.viz import style
from bns.worlds.trial import body_displacements

SHOWN = 300
"""Points drawn per group at most."""

_PANELS = (
    ("forward", 100.0, "cm"),
    ("left", 100.0, "cm"),
    ("turn", 180 / np.pi, "deg"),
)


_DOTS = {"markersize": 3, "alpha": 0.55, "markeredgewidth": 0}


def displacement(record: RunRecord):
    """Motion per command as foreseen by the SNN against the real one, per output."""
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(7.0, 3.0), layout="constrained")
        panels = figure.subplots(1, 3)
        for label, trials, colour in groups(record):
            real, foreseen = _pairs(record, trials)
            for column, axes in enumerate(panels):
                factor = _PANELS[column][1]
                x, y = real[:, column] * factor, foreseen[:, column] * factor
                axes.plot(x, y, "o", color=colour, label=label, **_DOTS)
        for axes, (name, _, unit) in zip(panels, _PANELS, strict=True):
            axes.axline((0, 0), slope=1, color=style.BLACK, linewidth=0.8)
            axes.set_title(f"{name} [{unit}]")
            axes.set_xlabel("real")
        panels[0].set_ylabel("foreseen")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="outside lower center", ncols=3, markerscale=2
        )
    return figure


def groups(record: RunRecord) -> list[tuple[str, range, str]]:
    """(label, trials, colour): before damage, just after it, at the end."""
    found = [int(onset) for onset in record.damage_onset if onset >= 0]
    last, total = min(10, record.trials), record.trials
    if not found or min(found) >= total:
        first = range(min(5, total))
        return [
            (f"first {len(first)} trials", first, style.DAMAGED),
            (f"last {last} trials", range(total - last, total), style.AFTER),
        ]
    onset = min(found)
    end = range(max(total - last, min(onset + 5, total)), total)
    return [
        ("before damage", range(max(onset - 10, 0), onset), style.BEFORE),
        ("just damaged", range(onset, min(onset + 5, total)), style.DAMAGED),
        (f"last {len(end)} trials", end, style.AFTER),
    ]


def _pairs(record: RunRecord, trials: range) -> tuple[np.ndarray, np.ndarray]:
    """Real and foreseen displacements, ``(N, 3)`` each, evenly thinned."""
    real, foreseen = (
        body_displacements(poses[:, trials.start : trials.stop]).reshape(-1, 3)
        for poses in (record.poses, record.predicted)
    )
    whole = np.isfinite(real).all(axis=1) & np.isfinite(foreseen).all(axis=1)
    at = np.flatnonzero(whole)
    at = at[:: max(1, -(-len(at) // SHOWN))]
    return real[at], foreseen[at]
