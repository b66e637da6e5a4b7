"""Recordings as files, whole or as they were before, and curves on their timeline."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.storage import files
from bns.viz.blueprint import LIVE_TIMELINE

if TYPE_CHECKING:
    from rerun import RecordingStream


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
