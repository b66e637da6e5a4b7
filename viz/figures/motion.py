"""Where the robot went, each command's motion; what was foreseen of either."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bns.experiment.record import RunRecord
from bns.tasks import registry as tasks
from bns.tasks.base import BOARD as HALF
from bns.viz import style
from bns.viz.choices import Choice, choose, typical
from bns.viz.facts import who
from bns.viz.paths import arcs, listed
from bns.worlds.trial import body_displacements

if TYPE_CHECKING:
    from matplotlib.axes import Axes
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
    """Motion per command as foreseen against the real one, per output."""
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
        panels[0].set_ylabel("predicted")
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


BOARD = np.array(HALF)
"""m; beyond the board paths are cut"""

_FORESEEN: Any = {"color": style.BLACK, "linewidth": 1.3, "ls": (0, (3, 2))}


def path(
    record: RunRecord,
    *,
    replicate: int | None = None,
    choices: Sequence[Choice] | None = None,
) -> "Figure":
    """Paths of chosen trials of one replicate, a panel each.

    Args:
        record: the batch.
        replicate: which run; by default the typical one.
        choices: which trials; by default `choices.choose`.
    """
    replicate = typical(record) if replicate is None else replicate
    chosen = choose(record, replicate) if choices is None else choices
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(7.0, 3.4), layout="compressed")
        panels = figure.subplots(
            1, len(chosen), squeeze=False, sharex=True, sharey=True
        )
        for axes, choice in zip(panels[0], chosen, strict=True):
            _objectives(axes, record)
            at = (replicate, choice.trial)
            _paths(axes, record, at, choice.colour)
            axes.set_title(f"trial {choice.trial}\n{choice.label}", color=choice.colour)
            axes.set_xlabel("x [m]")
            axes.set_aspect("equal", "box")
        _frame(panels[0, 0], record, [(replicate, c.trial) for c in chosen])
        panels[0, 0].set_ylabel("y [m]")
        handles, labels = panels[0, -1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _objectives(axes: "Axes", record: RunRecord) -> None:
    from matplotlib.patches import Circle

    shown = tasks.of(record.config).picture
    for name, (x, y) in shown.objectives.items():
        axes.add_patch(
            Circle((x, y), shown.radius, color=style.YELLOW, alpha=0.55, lw=0)
        )
        axes.annotate(name, (x, y), ha="center", va="center", fontweight="bold")


def _paths(axes: "Axes", record: RunRecord, at: tuple[int, int], colour: str) -> None:
    """Foreseen and real path; what follows the last objective is faint."""
    foreseen = f"as the {who(record)} predicted it"
    shown: Any = (
        (record.predicted[at], _FORESEEN, foreseen),
        (record.poses[at], {"color": colour, "linewidth": 2.0}, "as the robot went"),
    )
    for poses, line, label in shown:
        poses = listed(poses)
        if len(poses) < 2:
            continue
        done = tasks.of(record.config).finish(poses)
        axes.plot(*arcs(poses[: done + 1])[:, :2].T, label=label, **line)
        if done + 1 < len(poses):
            axes.plot(*arcs(poses[done:])[:, :2].T, alpha=0.3, **line)
    real = listed(record.poses[at])
    if len(real):
        end = real[tasks.of(record.config).finish(real), :2]
        axes.plot(*real[0, :2], "o", color=style.BLACK, markersize=5, label="start")
        axes.plot(*end, "s", color=colour, mec=style.BLACK, markersize=5, label="end")


def _until_done(record: RunRecord, at: tuple[int, int]) -> np.ndarray:
    """The real path up to the last objective; the start alone if there is none."""
    poses = listed(record.poses[at])
    if len(poses) < 2:
        return np.zeros((1, 3))
    return arcs(poses[: tasks.of(record.config).finish(poses) + 1])


def _frame(axes: "Axes", record: RunRecord, shown: Any) -> None:
    """The objectives and the paths, but nothing beyond the board."""
    half = np.array(tasks.of(record.config).picture.extent)
    paths = np.concatenate([_until_done(record, at)[:, :2] for at in shown])
    low = np.minimum(-half, np.maximum(paths.min(axis=0) - 0.05, -BOARD))
    high = np.maximum(half, np.minimum(paths.max(axis=0) + 0.05, BOARD))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    wide, tall = high - low
    panel = 6.3 / len(shown)
    whole: Any = axes.figure
    whole.set_figheight(min(panel * tall / wide, 4.0) + 1.25)
