"""Figures of light following: what sensors read, and where robots went from where."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bns.experiment.record import RunRecord
from bns.tasks.base import BOARD
from bns.viz import scene, style
from bns.viz.choices import choose, typical
from bns.viz.facts import who
from bns.viz.paths import listed
from bns.worlds.light.law import LightField
from bns.worlds.light.sensors import LightSensors

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


SIDES = ("left", "right")


def readings(record: RunRecord, *, replicate: int | None = None) -> "Figure":
    """Readings of chosen trials of one replicate, a column each.

    Args:
        record: the batch, of light following.
        replicate: which run; by default the typical one.
    """
    replicate = typical(record) if replicate is None else replicate
    chosen = choose(record, replicate)
    real = record.extra["readings"][replicate]
    foreseen = record.extra.get("readings_predicted")
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
                if foreseen is not None:
                    axes.plot(
                        times,
                        foreseen[replicate, choice.trial, :, row],
                        color=style.BLACK,
                        linewidth=1.0,
                        ls=(0, (3, 2)),
                        label=f"as the {who(record)} predicted it",
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


LAST = 12
"""trials shown"""


def starts(record: RunRecord, *, replicate: int | None = None) -> "Figure":
    """Where the robot went in the last trials, by start.

    Args:
        record: the batch, of light following.
        replicate: which run; by default the typical one.
    """
    from matplotlib.patches import Circle

    replicate = typical(record) if replicate is None else replicate
    shown = range(max(0, record.trials - LAST), record.trials)
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(7.0, 4.9), layout="constrained")
        axes = figure.subplots()
        shown_task = scene.picture(record.config)
        for x, y in shown_task.objectives.values():
            ring = {"fill": False, "color": style.YELLOW, "linewidth": 3.0}
            axes.add_patch(Circle((x, y), shown_task.radius, **ring))
            axes.plot(x, y, "*", color=style.YELLOW, markersize=14)
        for number, trial in enumerate(shown):
            poses = listed(record.poses[replicate, trial])
            share = number / max(len(shown) - 1, 1)
            colour = style.SKY if record["solved"][replicate, trial] else style.ORANGE
            axes.plot(*poses[:, :2].T, color=colour, alpha=0.35 + 0.65 * share, lw=1.2)
            axes.plot(*poses[0, :2], "o", color=style.BLACK, markersize=4)
            if record["lamp_stops"][replicate, trial] > 0:
                axes.plot(*poses[-1, :2], "x", color=style.BLACK, markersize=7)
        half = np.array(BOARD)
        axes.set_xlim(-half[0], half[0])
        axes.set_ylim(-half[1], half[1])
        axes.set_aspect("equal", "box")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        solved = int(record["solved"][replicate, list(shown)].sum())
        axes.set_title(
            f"trials {shown[0]} to {shown[-1]}: {solved} of {len(shown)} circled the "
            "lamp (blue)"
        )
    return figure


READINGS = 18_000
"""taken from different angles and positions (thesis 5.2.1, figure 5.5)"""

SPAN = np.deg2rad(10.0)
"""rad; half the width of the moving mean (thesis 5.2.1)"""

ARENA = np.array([2.7, 1.8])  # m; the board (thesis 4.2.6)
NEAREST = 0.15  # m; readings are taken outside the safety boundary (assumed)
_SMALL = {"fontsize": 7, "columnspacing": 0.8, "handlelength": 1.0}
_COLOURS = (
    style.BLUE,
    style.GREEN,
    style.ORANGE,
    style.VERMILION,
    style.PURPLE,
    style.SKY,
)


class Roamed(NamedTuple):
    """Readings of a robot that was put all over the board.

    Attributes:
        angle: to the lamp from where the robot looks, + = left, ``(n,)`` [rad].
        counts: of each sensor, ``(n, S)``.
    """

    angle: np.ndarray
    counts: np.ndarray


def roamed(
    sensors: LightSensors,
    field: LightField,
    *,
    readings: int = READINGS,
    seed: int = 0,
) -> Roamed:
    """Readings at random places of the board, headings evenly spread.

    Args:
        sensors, field: what is read; angles are to the first lamp.
        readings: how many.
        seed: of places, order and noise.
    """
    rng = np.random.default_rng(seed)
    lamp = field.positions[0, :2]
    places = rng.uniform(-ARENA / 2, ARENA / 2, (4 * readings, 2))
    far = np.hypot(*(places - lamp).T) > NEAREST
    places = places[far][:readings]
    angle = np.linspace(-np.pi, np.pi, len(places), endpoint=False)
    way = lamp - places
    yaw = np.arctan2(way[:, 1], way[:, 0]) - angle
    poses = np.column_stack([places, yaw])
    return Roamed(angle, sensors.counts(field, poses, rng=rng))


def moving_mean(angle: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Mean of all values within `SPAN` of each angle.

    Args:
        angle: of the values [rad], ``(n,)``.
        values: ``(n, S)``.
        at: where the mean is wanted [rad], ``(A,)``.

    Returns:
        Shape ``(A, S)``.
    """
    off = np.abs((angle - at[:, None] + np.pi) % (2 * np.pi) - np.pi)
    near = (off <= SPAN).astype(float)
    return near @ values / near.sum(axis=1, keepdims=True)


def light_responses(
    sensors: LightSensors, field: LightField, *, seed: int = 0
) -> "Figure":
    """Readings over the angle to the lamp: means, one sensor, the virtual two.

    Args:
        sensors, field: what is read.
        seed: see `roamed`.
    """
    many = roamed(sensors, field, seed=seed)
    single = roamed(sensors, field, readings=360, seed=seed + 1)
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(9.6, 3.4), layout="constrained")
        left, middle, right = figure.subplots(1, 3, sharey=True)
        _means(left, sensors, many)
        front = sensors.names.index("ir_front_left")
        middle.plot(
            np.degrees(single.angle), single.counts[:, front], color=style.ORANGE, lw=1
        )
        degrees = round(np.degrees(sensors.heading[front]))
        middle.set_title(f"One reading each, sensor at {degrees}°")
        virtual = sensors.virtual(single.counts)
        for column, (side, colour) in enumerate(
            (("left", style.BLUE), ("right", style.VERMILION))
        ):
            right.plot(
                np.degrees(single.angle), virtual[:, column], color=colour, lw=1,
                label=side,
            )  # fmt: skip
        right.set_title("One reading each, virtual sensors")
        right.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.2))
        left.set_ylabel("reading [count], small is bright")
        for axes in (left, middle, right):
            axes.set_xlabel("lamp to the left [deg]")
            axes.set_xticks(range(-180, 181, 90))
    return figure


def _means(axes: "Axes", sensors: LightSensors, many: Roamed) -> None:
    at = np.deg2rad(np.arange(-180, 181, 2))
    means = moving_mean(many.angle, many.counts, at)
    forward = np.flatnonzero(np.abs(sensors.heading) < np.pi / 2 + 0.01)
    forward = forward[np.argsort(sensors.heading[forward])]
    for column, colour in zip(forward, _COLOURS, strict=False):
        degrees = round(np.degrees(sensors.heading[column]))
        axes.plot(np.degrees(at), means[:, column], color=colour, label=f"{degrees}°")
    axes.set_title("Mean of readings within 10°")
    axes.legend(ncols=6, loc="upper center", bbox_to_anchor=(0.5, -0.2), **_SMALL)
