"""What the simulator network foresaw of each command against what happened."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bns.experiment.record import RunRecord
from bns.viz import style
from bns.worlds.trial import body_displacements

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SHOWN = 300
"""Points drawn per group at most."""

_PANELS = (
    ("forward", 100.0, "cm"),
    ("left", 100.0, "cm"),
    ("turn", 180 / np.pi, "deg"),
)


_DOTS = {"markersize": 3, "alpha": 0.55, "markeredgewidth": 0}


def displacement(record: RunRecord) -> "Figure":
    """Motion per command as foreseen by the SNN against the real one, per output."""
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(7.0, 3.0), layout="constrained")
        panels = figure.subplots(1, 3)
        shown = [(group, *_pairs(record, group.trials)) for group in groups(record)]
        limits = _limits([real for _, real, _ in shown])
        for group, real, foreseen in shown:
            dots = _DOTS | {"color": group.colour, "label": group.label}
            for column, axes in enumerate(panels):
                factor = _PANELS[column][1]
                y = np.clip(foreseen[:, column], *limits[column])
                axes.plot(real[:, column] * factor, y * factor, "o", **dots)
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


class Group(NamedTuple):
    """Trials whose commands are drawn in one colour."""

    label: str
    trials: range
    colour: str


def groups(record: RunRecord) -> list[Group]:
    """Trials before damage, just after it, and at the end."""
    found = [int(onset) for onset in record.damage_onset if onset >= 0]
    last, total = min(10, record.trials), record.trials
    if not found or min(found) >= total:
        first = range(min(5, total))
        return [
            Group(f"first {len(first)} trials", first, style.DAMAGED),
            Group(f"last {last} trials", range(total - last, total), style.AFTER),
        ]
    onset = min(found)
    end = range(max(total - last, min(onset + 5, total)), total)
    return [
        Group("before damage", range(max(onset - 10, 0), onset), style.BEFORE),
        Group("just damaged", range(onset, min(onset + 5, total)), style.DAMAGED),
        Group(f"last {len(end)} trials", end, style.AFTER),
    ]


def _limits(real: list[np.ndarray]) -> np.ndarray:
    """Lowest and highest value shown of each output, ``(3, 2)``.

    A third more than what really happened: a network far outside its data foresees
    anything, and one such dot would hide all others.
    """
    found = np.concatenate(real)
    if not len(found):
        return np.tile([-1.0, 1.0], (3, 1))
    low, high = found.min(axis=0), found.max(axis=0)
    margin = np.maximum(0.33 * (high - low), 1e-6)
    return np.stack([low - margin, high + margin], axis=1)


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
