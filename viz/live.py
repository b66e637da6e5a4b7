"""A run, streamed to a Rerun viewer trial by trial while it goes on.

What goes wrong here is said once and never stops the run.
"""

import logging
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from bns.errors import install
from bns.experiment.config import RunConfig
from bns.experiment.step import Step
from bns.viz import charts, moments, scene
from bns.viz.blueprint import blueprint
from bns.viz.picture import LOOPBACK, executable, free_port, wait
from bns.viz.recording import open_stream
from bns.worlds.trial import Trial

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
