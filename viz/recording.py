"""Rerun recordings of a run: the world in 3D, chosen trials, learning over trials.

An `.rrd` is a view, never the archive: it opens in this version of Rerun and the
next. Everything is written in columns on explicit streams.
"""

from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from bns.experiment import loading
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.viz import charts, moments, rrd, scene
from bns.viz.blueprint import blueprint
from bns.viz.choices import Choice, choose, typical
from bns.worlds.trial import Trial


def write(
    record: RunRecord,
    trials: Mapping[int, Trial] | Sequence[Trial],
    path: str | Path,
    *,
    replicate: int | None = None,
    choices: Sequence[Choice] | None = None,
    model: Any = None,
) -> Path:
    """Write the recording of one replicate.

    Args:
        record: the batch it belongs to.
        trials: densely sampled trials of that replicate, by trial number (a list
            counts from 0). A chosen trial that is not among them is drawn from the
            poses at its commands' ends, joined by arcs.
        path: file to write, `.rrd`.
        replicate: which run; by default the typical one (`choices.typical`).
        choices: which trials; by default before, just after and recovered
            (`choices.choose`).
        model: compiled scene to show; by default the scene of the record's robot.

    Returns:
        The path written.

    Raises:
        OutOfBoundsError: there is no such replicate.
    """
    import rerun as rr

    replicate = typical(record) if replicate is None else replicate
    chosen = tuple(choices) if choices is not None else choose(record, replicate)
    model = scene.compiled(record.config.world.robot) if model is None else model
    stream = open_stream(record.config, replicate)
    seconds = moments.duration(record, replicate, chosen)
    shown = scene.picture(record.config)
    layout = blueprint(
        shown,
        seconds=seconds,
        readings="readings" in record.extra,
        charts=charts.chart_titles(record.columns, shown),
    )
    with rrd.saved(stream, path, layout):
        stream.send_recording_name(
            f"{record.config.preset or shown.name} / replicate {replicate}"
        )
        stream.send_property("run", rr.AnyValues(**_properties(record, replicate)))
        scene.log_static(stream, record.config, model)
        moments.send(stream, record, replicate, chosen, _by_number(trials), model)
        charts.log_bars(stream, record, replicate, chosen)
        numbers = np.arange(record.trials)
        columns = {name: values[replicate] for name, values in record.columns.items()}
        charts.log_curve_styles(stream)
        charts.send_curves(stream, numbers, columns)
        moments.send_paths(
            stream, numbers, record.poses[replicate], record.predicted[replicate]
        )
        moments.send_ends(stream, numbers, record.poses[replicate], model)
        stream.log("about", _about(record, replicate, chosen), static=True)
    return Path(path)


def open_stream(config: RunConfig, replicate: int) -> Any:
    """A named stream without wall-clock timelines or a start time of its own.

    The same configuration and replicate are the same recording to the viewer.
    """
    import rerun as rr

    digest = sha256(loading.to_toml(config).encode()).hexdigest()[:12]
    identity = f"{digest}-{replicate}"
    stream = rr.RecordingStream("bns", recording_id=identity, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


def _by_number(trials: Any) -> Mapping[int, Trial]:
    return trials if isinstance(trials, Mapping) else dict(enumerate(trials))


def _properties(record: RunRecord, replicate: int) -> dict:
    config = record.config
    return {
        "task": scene.picture(config).name,
        "robot": config.world.robot,
        "world": config.world.name,
        "damage": " + ".join(config.world.damage) or "none",
        "seed": config.seed,
        "replicate": replicate,
        "window": config.adaptation.window,
        "trials": record.trials,
    }


def _about(record: RunRecord, replicate: int, chosen: Sequence[Choice]) -> Any:
    import rerun as rr

    shown = scene.picture(record.config)
    lines = [
        f"# {record.config.preset or shown.name}, replicate {replicate}",
        "",
        "**World.** Solid trails are where the robot went, dashed trails where its "
        "simulator network (SNN) said it would go. " + shown.discs + " Press "
        "play: the robot goes through the trials below, one after another.",
        "",
        *(f"- trial {choice.trial}: {choice.label}" for choice in chosen),
        "",
        f"**Damage.** {' + '.join(record.config.world.damage) or 'none'}; first "
        f"damaged trial: {_onset(record, replicate)}.",
        "",
        "**Over trials.** Bars: grey before damage, dark orange after; the shown "
        "trials have their trails' colours. For curves, choose the timeline "
        "`trial` at the bottom left: the paths then are those of each trial.",
    ]
    return rr.TextDocument("\n".join(lines), media_type=rr.MediaType.MARKDOWN)


def _onset(record: RunRecord, replicate: int) -> str:
    onset = int(record.damage_onset[replicate])
    return str(onset) if onset >= 0 else "none"
