"""Figures over trials in a recording: bars that are always seen, curves on `trial`."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.experiment.record import RunRecord
from bns.tasks import Picture
from bns.tasks import registry as tasks
from bns.viz import style
from bns.viz.choices import Choice
from bns.viz.rrd import TRIAL_TIMELINE

if TYPE_CHECKING:
    from rerun import RecordingStream


MILLIMETRES = 1000.0
DEGREES = 180.0 / np.pi

FITNESS, DIVERSITY = "charts/fitness", "charts/diversity"
SNN_ERROR = "charts/snn_error"

_CURVES = {
    "curves/fitness/tried_in_the_world": (
        "fitness",
        1.0,
        style.SKY,
        "tried in the world",
    ),
    "curves/fitness/foreseen_by_the_snn": (
        "fitness_predicted",
        1.0,
        style.PURPLE,
        "foreseen by the SNN",
    ),
    "curves/reached/objectives": ("reached", 1.0, style.GREEN, "objectives"),
    "curves/diversity/equation_4_1": ("diversity_41", 1.0, style.SKY, "equation 4.1"),
    "curves/snn_error/forward_mm": (
        "snn_forward",
        MILLIMETRES,
        style.SKY,
        "forward [mm]",
    ),
    "curves/snn_error/left_mm": ("snn_left", MILLIMETRES, style.ORANGE, "left [mm]"),
    "curves/snn_error/turn_deg": ("snn_turn", DEGREES, style.PURPLE, "turn [deg]"),
}
"""Entity: column, factor to the unit shown, colour, name."""


def log_bars(
    stream: "RecordingStream",
    record: RunRecord,
    replicate: int,
    chosen: Sequence[Choice],
) -> None:
    """Log one bar a trial for fitness, diversity and SNN error, as statics.

    A chart over trials could not be seen while the time line counts seconds; bars
    are on no time line. A series each for the trials before damage, after it, and
    for every chosen trial.

    Args:
        stream: Rerun's recording stream.
        record: of the run.
        replicate: which of its runs.
        chosen: trials to set apart.
    """
    import rerun as rr

    columns = {name: values[replicate] for name, values in record.columns.items()}
    shown = tasks.of(record.config).picture
    for path, _ in chart_titles(columns, shown):
        series = _bar_values(path, columns, shown)
        for name, colour, member in _groups(record, replicate, chosen):
            bars = np.where(member, np.nan_to_num(series), 0.0)
            stream.log(
                f"{path}/{name}",
                rr.BarChart(bars, color=style.rgb(colour)),
                static=True,
            )


def chart_titles(
    columns: Mapping[str, np.ndarray], shown: Picture
) -> list[tuple[str, str]]:
    """The charts that a record's columns allow: entity and title."""
    found = [(FITNESS, shown.curve.chart)]
    if "diversity_41" in columns:
        found.append((DIVERSITY, "Diversity of the population over trials"))
    if "snn_forward" in columns:
        found.append((SNN_ERROR, "SNN position error over trials [mm per command]"))
    return found


def _bar_values(
    path: str, columns: Mapping[str, np.ndarray], shown: Picture
) -> np.ndarray:
    if path == DIVERSITY:
        return columns["diversity_41"]
    if path == SNN_ERROR:
        return np.hypot(columns["snn_forward"], columns["snn_left"]) * MILLIMETRES
    values = columns[shown.curve.column]
    return np.log10(np.maximum(values, 1.0)) if shown.curve.log else values


def _groups(
    record: RunRecord, replicate: int, chosen: Sequence[Choice]
) -> Iterator[Any]:
    """(name, colour, which trials) of each series of bars."""
    number = np.arange(record.trials)
    shown = np.isin(number, [choice.trial for choice in chosen])
    onset = int(record.damage_onset[replicate])
    onset = onset if onset >= 0 else record.trials
    yield "undamaged", style.GREY, ~shown & (number < onset)
    if onset < record.trials:
        yield "damaged", "#8a4a1c", ~shown & (number >= onset)
    for choice in chosen:
        yield f"trial_{choice.trial}", choice.colour, number == choice.trial


def log_curve_styles(stream: "RecordingStream") -> None:
    """Log names and colours of the curves that `send_curves` sends."""
    import rerun as rr

    for path, (_, _, colour, name) in _CURVES.items():
        stream.log(
            path,
            rr.SeriesLines(names=name, colors=style.rgb(colour), widths=2.0),
            static=True,
        )


def send_curves(
    stream: "RecordingStream", numbers: np.ndarray, columns: Mapping[str, np.ndarray]
) -> None:
    """Send figures over trials as curves on the timeline `trial`.

    Args:
        stream: a `rerun.RecordingStream`.
        numbers: numbers of the N trials.
        columns: those of one replicate, as in `RunRecord.columns`, ``(N,)`` each.
    """
    import rerun as rr

    index = [rr.TimeColumn(TRIAL_TIMELINE, sequence=numbers)]
    for path, (column, factor, *_) in _CURVES.items():
        if column not in columns:
            continue
        values = np.asarray(columns[column]) * factor
        stream.send_columns(path, index, rr.Scalars.columns(scalars=values))
