"""Rerun recordings of a run: the world in 3D, chosen trials, learning over trials.

An `.rrd` is a view, never the archive: it opens in this version of Rerun and the
next. Everything is written in columns on explicit streams.

A run can be streamed to a viewer, too, trial by trial while it goes on. What goes wrong
there is said once and never stops the run.
"""

import logging
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import install
from bns.experiment import loading
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord, Step
from bns.viz import charts, facts, moments, rrd, scene
from bns.viz.choices import Choice, choose, typical
from bns.viz.pictures import LOOPBACK, executable, free_port, wait
from bns.viz.rrd import blueprint
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
        f"**World.** Solid trails are where the robot went{_dashed(record)}. "
        f"{shown.discs} Press play: the robot goes through the trials below, one after "
        "another.",
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


def _dashed(record: RunRecord) -> str:
    """What dashed trails are, where there are any."""
    if not facts.foresees(record):
        return ""
    return f", dashed trails where the {facts.who(record)} said it would go"


def _onset(record: RunRecord, replicate: int) -> str:
    onset = int(record.damage_onset[replicate])
    return str(onset) if onset >= 0 else "none"


log = logging.getLogger(__name__)

_FAILURES = (RuntimeError, OSError, ValueError, KeyError)
"""What the viewer, its connection and unexpected data raise."""


@contextmanager
def stream(
    config: RunConfig, *, replicate: int = 0, url: str | None = None
) -> Iterator[Callable[[int, Step, Sequence[Trial]], None]]:
    """Show one replicate of a run that is going on.

    Args:
        config: the run's configuration.
        replicate: which of its runs to show.
        url: a viewer to send to (``rerun+http://127.0.0.1:9876/proxy``); by default
            one is started here.

    Yields:
        What to call after every trial, the `on_trial` of `bns.experiment.run.train`.
    """
    shown = Stream(config, replicate=replicate, url=url)
    try:
        yield shown.on_trial
    finally:
        shown.close()


class Stream:
    """See `stream`."""

    def __init__(
        self, config: RunConfig, *, replicate: int = 0, url: str | None = None
    ) -> None:
        self._config, self._replicate = config, replicate
        self._stream = self._model = None
        self.failed = False
        self._guard(lambda: self._open(url))

    def on_trial(self, number: int, step: Step, trials: Sequence[Trial] = ()) -> None:
        """Send one trial, in one batch.

        Args:
            number: of the trial, counted from 0.
            step: what the runs did in it.
            trials: not used.
        """
        self._guard(lambda: self._send(number, step))

    def close(self) -> None:
        """Send what is left."""
        self._guard(self._disconnect)

    def _open(self, url: str | None) -> None:
        os.environ.setdefault("RERUN_ANALYTICS", "0")
        made = open_stream(self._config, self._replicate)
        layout = blueprint(scene.picture(self._config), follow=True)
        made.connect_grpc(url or _spawn(), default_blueprint=layout)
        self._model = scene.compiled(self._config.world.robot)
        scene.log_static(made, self._config, self._model)
        charts.log_curve_styles(made)
        self._stream = made

    def _send(self, number: int, step: Step) -> None:
        at = self._replicate
        columns = {name: values[at : at + 1] for name, values in step.columns.items()}
        real, predicted = (
            step.arrays[name][at : at + 1] for name in ("poses", "predicted")
        )
        numbers = np.array([number])
        if self._stream is None:
            return
        charts.send_curves(self._stream, numbers, columns)
        moments.send_paths(self._stream, numbers, real, predicted)
        moments.send_ends(self._stream, numbers, real, self._model)

    def _disconnect(self) -> None:
        if self._stream is not None:
            self._stream.flush(timeout_sec=5)
            self._stream.disconnect()

    def _guard(self, act: Callable[[], None]) -> None:
        """Do it unless something failed before; say what failed, and go on."""
        if self.failed:
            return
        try:
            act()
        except _FAILURES as error:
            self.failed = True
            log.warning("The live view is off, the run goes on: %s", error)


def _spawn() -> str:
    """Start a viewer that outlives this process; gives where it listens."""
    if _no_display():
        raise RuntimeError(
            "there is no display to start a viewer on; save the recording instead and "
            "make a picture of it (bns view --png)"
        )
    program, port = executable(), free_port()
    if program is None:
        raise RuntimeError(f"there is no Rerun viewer ({install('view')})")
    where = ["--bind", LOOPBACK, "--port", str(port)]
    process = subprocess.Popen(
        [program, *where, "--hide-welcome-screen"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    wait(process, port)
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def _no_display() -> bool:
    if sys.platform != "linux":
        return False
    return not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
