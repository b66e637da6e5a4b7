"""Recordings as files, whole or as they were before, and how they look when opened.

`blueprint` is the layout; values are sent as curves on their timeline.
"""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.storage import files
from bns.tasks import Picture

if TYPE_CHECKING:
    from rerun import RecordingStream

LIVE_TIMELINE, TRIAL_TIMELINE = "sim_time", "trial"
"""Time within the trials shown [s]; number of the trial."""

CURVES = (
    ("curves/fitness", "Fitness"),
    ("curves/reached", "Objectives reached"),
    ("curves/diversity", "Diversity"),
    ("curves/snn_error", "SNN error"),
)
"""The same as curves on the timeline `trial`."""

READINGS = "readings"
"""What the light sensors read, and what was foreseen."""

BACKGROUND = (27, 30, 36)


def blueprint(
    shown: Picture,
    *,
    seconds: float = 0.0,
    follow: bool = False,
    readings: bool = False,
    charts: Sequence[tuple[str, str]] = (),
) -> Any:
    """The layout: the world on the left, learning on the right.

    The camera looks from the front (negative y) down on a board of the given size.

    Args:
        shown: what is shown of the task.
        seconds: length of what is shown on `sim_time` [s]; 0 = not known.
        follow: open on the timeline `trial` and follow its end (live streams).
        readings: show what light sensors read.
        charts: static bar charts over trials, entity and title.
    """
    import rerun.blueprint as rrb

    world = _world(rrb, *shown.extent)
    seen = [_wheels(rrb, seconds)] if shown.wheels else []
    seen += [_readings(rrb, seconds)] if readings else []
    left = _left(rrb, world, seconds, seen)
    curves = rrb.Vertical(
        *(_curve(rrb, path, name) for path, name in CURVES),
        name="Curves (choose the timeline 'trial')",
    )
    right = rrb.Tabs(
        rrb.Vertical(
            *(_bars(rrb, path, name) for path, name in charts),
            name="Over trials",
        ),
        curves,
        rrb.TextDocumentView(origin="/about", name="How to read this"),
        active_tab=0,
    )
    parts = (world, curves) if follow else (left, right)
    return rrb.Blueprint(
        rrb.Horizontal(*parts, column_shares=[3, 2]),
        rrb.TimePanel(
            state="collapsed",
            timeline=TRIAL_TIMELINE if follow else LIVE_TIMELINE,
            play_state="following" if follow else "paused",
        ),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _left(rrb: Any, world: Any, seconds: float, seen: list) -> Any:
    """The world, which trial is on, and what is `seen` over time besides."""
    return rrb.Vertical(
        world,
        rrb.StateTimelineView(
            origin="/moment", name="Which trial is on", time_view=_axis(rrb, seconds)
        ),
        *seen,
        row_shares=[6, 1.1, *[1.9 for _ in seen]],
    )


def _wheels(rrb: Any, seconds: float) -> Any:
    return rrb.TimeSeriesView(
        origin="/wheels",
        name="Wheel speeds as sent [m/s]",
        axis_x=_axis(rrb, seconds),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )


def _bars(rrb: Any, path: str, name: str) -> Any:
    hidden = rrb.PlotLegend(visible=False)
    return rrb.BarChartView(origin=path, name=name, plot_legend=hidden)


def _readings(rrb: Any, seconds: float) -> Any:
    return rrb.TimeSeriesView(
        origin=f"/{READINGS}",
        name="Light sensors [counts]; smaller is brighter; thin: predicted",
        axis_x=_axis(rrb, seconds),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )


def _axis(rrb: Any, seconds: float) -> Any:
    """The time axis over all that is shown, or None where that is not known."""
    if seconds <= 0:
        return None
    span = rrb.TimeRange(
        rrb.TimeRangeBoundary.absolute(seconds=0.0),
        rrb.TimeRangeBoundary.absolute(seconds=seconds),
    )
    return rrb.TimeAxis(view_range=span)


def _world(rrb: Any, half_width: float, half_depth: float) -> Any:
    """The 3D view with its camera."""
    away = max(half_width, 1.4 * half_depth)
    return rrb.Spatial3DView(
        origin="/world",
        name="World",
        background=list(BACKGROUND),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(0.0, -1.15 * away, 1.5 * away),
            look_target=(0.0, -0.05, 0.0),
            eye_up=(0, 0, 1),
        ),
    )


def _curve(rrb: Any, path: str, name: str) -> Any:
    return rrb.TimeSeriesView(
        origin=path, name=name, plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop)
    )


END = b"RRF2FOOT"  # with four bytes after it, the end of a whole recording


@contextmanager
def saved(stream: Any, path: Path | str, layout: Any) -> Iterator[Path]:
    """Let the block fill a stream, whose file then takes the place of `path`.

    Args:
        stream: a `rerun.RecordingStream`; disconnected at the end.
        path: of the file.
        layout: of the views.

    Raises:
        StorageError: no space, or no permission; what was at `path` is still there.
    """
    path = Path(path)
    beside = path.with_name(f"{files.TEMPORARY}rrd-{path.name}")
    try:
        stream.save(str(beside), default_blueprint=layout)
        yield path
        stream.flush()
        stream.disconnect()
        with open(beside, "rb") as file:
            file.seek(0, os.SEEK_END)
            file.seek(max(0, file.tell() - len(END) - 4))
            tail = file.read()
    except (RuntimeError, OSError) as error:
        files.remove(beside)
        raise _error(path, error) from error
    if not tail.startswith(END):
        files.remove(beside)
        raise _error(path, "it is not whole")
    files.replace(path, lambda there: beside.replace(there))


def _error(path: Path, reason: object) -> files.StorageError:
    return files.StorageError(
        f"{path} cannot be written ({reason}): what was there before is untouched. "
        "Free some space, or give another place."
    )


AFTER = 1e-3  # [s] after the last value, where the viewer is told that there is none


def times(seconds: np.ndarray) -> Any:
    """A column of times on the timeline of motion [s]."""
    import rerun as rr

    return [rr.TimeColumn(LIVE_TIMELINE, duration=np.atleast_1d(seconds))]


def send(
    stream: "RecordingStream", path: str, seconds: np.ndarray, values: np.ndarray
) -> None:
    """Send one trial's part of a curve; no line leads from it to the next trial.

    Args:
        stream: a `rerun.RecordingStream`.
        path: of the curve.
        seconds: when, ``(N,)`` [s]; rising.
        values: ``(N,)``.
    """
    import rerun as rr

    if len(seconds) == 0:
        return
    stream.send_columns(
        path,
        times(np.append(seconds, seconds[-1] + AFTER)),
        rr.Scalars.columns(scalars=np.append(values, np.nan)),
    )
