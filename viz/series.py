"""The timeline of motion, and curves on it that end where their trial ends."""

import numpy as np

from bns.viz.blueprint import LIVE_TIMELINE

AFTER = 1e-3  # [s] after the last value, where the viewer is told that there is none


def times(seconds: np.ndarray):
    """A column of times on the timeline of motion [s]."""
    import rerun as rr

    return [rr.TimeColumn(LIVE_TIMELINE, duration=np.atleast_1d(seconds))]


def send(stream, path: str, seconds: np.ndarray, values: np.ndarray) -> None:
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
