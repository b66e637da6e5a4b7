"""Rerun recording of a diagnosis: recorded, nominal and corrected robot together."""

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.gap.models.base import GapModel
from bns.gap.records import Diagnosis
from bns.viz import rrd, style
from bns.viz.gap import scene
from bns.viz.gap.figures import CORRECTED, MOST, NOMINAL, View, view
from bns.viz.rrd import BACKGROUND, LIVE_TIMELINE
from bns.worlds.trial import POSE, Channel, Trial

if TYPE_CHECKING:
    from rerun import RecordingStream


GAP = 1.0
"""s of pause between two trials"""

TRIALS = 6
"""trials that are shown at most, those with the largest gap"""

FLOOR = "noise_floor"
"""what the noise floor is called among the residuals"""


def write(
    found: Diagnosis, trials: Sequence[Trial], model: GapModel, path: str | Path
) -> Path:
    """Write the recording.

    Args:
        found: the diagnosis.
        trials: the recording it was made of.
        model: its nominal model.
        path: file to write, `.rrd`.
    """
    import rerun as rr

    seen = view(found, trials, model)
    losses = [seen.energy(number).mean() for number in range(len(seen.trials))]
    chosen = sorted(np.argsort(losses)[::-1][:TRIALS].tolist())
    starts = _starts(seen, chosen)
    identity = sha256(found.to_json().encode()).hexdigest()[:12]
    stream = rr.RecordingStream("bns", recording_id=identity, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stage = scene.Stage(seen, chosen) if scene.planar(seen) else None
    length = starts[-1] + _length(seen.trials[chosen[-1]])
    with rrd.saved(stream, path, _layout(seen, stage, length)):
        stream.send_recording_name(f"gap of {found.model}: {found.verdict.kind}")
        _styles(stream, seen)
        if stage:
            scene.log_static(stream, seen, stage)
        for number, start in zip(chosen, starts, strict=True):
            _residuals(stream, seen, number, start)
            _observed(stream, seen, number, start)
            if stage:
                scene.send(stream, seen, stage, number, start)
        stream.log("about", _about(found, chosen, stage), static=True)
    return Path(path)


def _length(trial: Trial) -> float:
    return float(trial.times[-1] - trial.times[0])


def _starts(seen: View, chosen: Sequence[int]) -> list[float]:
    lengths = [_length(seen.trials[number]) + GAP for number in chosen]
    return np.concatenate([[0.0], np.cumsum(lengths)[:-1]]).tolist()


def _path(root: str, channel: Channel, *names: str) -> str:
    """An entity's path; the channel's name may have spaces and brackets."""
    import rerun as rr

    return "/".join([root, rr.escape_entity_path_part(channel.name), *names])


def _styles(stream: "RecordingStream", seen: View) -> None:
    import rerun as rr

    colours = {"nominal": NOMINAL, "corrected": CORRECTED, FLOOR: style.GREEN}
    for feature in seen.problem.model.features:
        for name, colour in colours.items():
            stream.log(
                _path("residuals", feature, name),
                rr.SeriesLines(
                    names=name.replace("_", " "),
                    colors=style.rgb(colour),
                    widths=1.5,
                ),
                static=True,
            )
    bright = {"recorded": "#ffffff", "nominal": NOMINAL, "corrected": style.SKY}
    for channel in seen.trials[0].channels:
        for name, colour in bright.items():
            stream.log(
                _path("observed", channel, name),
                rr.SeriesLines(names=name, colors=style.rgb(colour), widths=1.5),
                static=True,
            )


def _residuals(
    stream: "RecordingStream", seen: View, number: int, start: float
) -> None:
    """Recorded minus predicted motion, window by window, in the features' units."""
    windows = seen.problem.windows[number]
    at = start + windows.times - seen.trials[number].times[0]
    shown = {"nominal": seen.gap(number), FLOOR: 2 * seen.scatter(number)}
    if seen.effects:
        shown["corrected"] = seen.left[number]
    for column, feature in enumerate(seen.problem.model.features):
        for name, values in shown.items():
            path = _path("residuals", feature, name)
            rrd.send(stream, path, at, values[:, column])


def _observed(stream: "RecordingStream", seen: View, number: int, start: float) -> None:
    trial = seen.trials[number]
    at = start + trial.times - trial.times[0]
    shown = {"recorded": trial.observed, "nominal": seen.nominal[number]}
    if seen.effects:
        shown["corrected"] = seen.corrected[number]
    for name, values in shown.items():
        for column, channel in enumerate(trial.channels):
            fine = np.isfinite(values[:, column])
            path = _path("observed", channel, name)
            rrd.send(stream, path, at[fine], values[fine, column])


def _features(seen: View) -> list[Channel]:
    """The features that are shown."""
    return [seen.problem.model.features[column] for column in seen.largest()]


def _channels(seen: View) -> list[Channel]:
    """The channels that are shown: the pose, and those whose feature is."""
    channels = list(seen.trials[0].channels)
    named = {feature.name for feature in _features(seen)}
    few = [c for c in channels if c.name in named or c.name in POSE]
    return channels if len(channels) <= MOST else few


def _layout(seen: View, stage: scene.Stage | None, length: float) -> Any:
    import rerun.blueprint as rrb

    span = rrb.TimeRange(
        rrb.TimeRangeBoundary.absolute(seconds=0.0),
        rrb.TimeRangeBoundary.absolute(seconds=length),
    )

    def plots(root: str, words: str, channels: Any) -> Any:
        """One below the other, a plot of each channel."""
        return rrb.Vertical(
            *(
                rrb.TimeSeriesView(
                    origin=_path(root, channel),
                    name=f"{channel.name} [{channel.unit}]{words}",
                    axis_x=rrb.TimeAxis(view_range=span),
                    plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
                )
                for channel in channels
            ),
            name="Residuals" if root == "residuals" else "Observed",
        )

    residuals = plots("residuals", ": recorded minus predicted", _features(seen))
    observed = plots("observed", "", _channels(seen))
    about = rrb.TextDocumentView(origin="/about", name="How to read this")
    if stage:
        parts = rrb.Horizontal(
            scene.view_3d(stage, BACKGROUND),
            rrb.Tabs(residuals, observed, about, active_tab=0),
            column_shares=[3, 2],
        )
    else:
        parts = rrb.Horizontal(
            residuals, rrb.Tabs(observed, about, active_tab=0), column_shares=[1, 1]
        )
    return rrb.Blueprint(
        parts,
        rrb.TimePanel(state="collapsed", timeline=LIVE_TIMELINE, play_state="paused"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _about(found: Diagnosis, chosen: Sequence[int], stage: scene.Stage | None) -> Any:
    import rerun as rr

    lines = [f"# {found.verdict.kind}", "", found.verdict.sentence, ""]
    if stage:
        lines += [
            "**Robots.** Side by side, on the same commands from the same start: the "
            "nominal model (orange), the recorded robot in its own colours, the "
            "corrected model (blue). Beside the models' paths the recorded one is "
            "drawn thin. The recorded path is black where the nominal model is right "
            "and red where it fails. Arrows show how its motion is wrong there, "
            f"{stage.longer:g} times enlarged.",
            "",
        ]
    lines += [
        "**Residuals.** Recorded minus predicted motion, window by window; the green "
        "line is two deviations of what the recording scatters by itself.",
        "",
        f"Trials shown, one after another: {', '.join(map(str, chosen))} (those with "
        "the largest gap).",
    ]
    return rr.TextDocument("\n".join(lines), media_type=rr.MediaType.MARKDOWN)
