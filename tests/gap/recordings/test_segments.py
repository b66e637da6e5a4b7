"""Pieces of recordings hold the samples and the commands of their time."""

import numpy as np
import pytest

from bns.gap.recordings import load_recordings, segments
from bns.worlds.trial import Commands, Trial

CHANNELS = load_recordings.model("khepera3").channels


def driven(lasting: float, samples: int, seconds: float = 60.0) -> Trial:
    """A trial of commands of so many seconds each, seen at a few samples."""
    count = round(seconds / lasting)
    told = np.stack([np.arange(count), -np.arange(count)], axis=1) / 1e4
    times = np.linspace(0.0, seconds, samples)
    ends = np.arange(count + 1) * lasting
    bounds = np.minimum(np.searchsorted(times, ends - 1e-9), samples - 1)
    poses = np.random.default_rng(0).normal(0, 1e-3, (samples, len(CHANNELS)))
    return Trial(
        Commands(told, np.full(count, lasting)), times, poses, bounds, channels=CHANNELS
    )


def at(trial: Trial, moments: np.ndarray) -> np.ndarray:
    """What is told at moments [s], ``(n, 2)``."""
    ends = np.cumsum(trial.commands.durations)
    which = np.searchsorted(ends, moments + 1e-6, side="right")
    return trial.commands.values[np.minimum(which, len(ends) - 1)]


@pytest.mark.parametrize("lasting", [3.0, 0.5, 0.05])
@pytest.mark.parametrize("ends", [(0, 30), (17, 93), (60, 119)])
def test_a_piece_is_told_what_the_whole_was(lasting, ends):
    whole = driven(lasting, 121)  # samples half a second apart
    part = segments.piece(whole, *ends)
    since, until = whole.times[list(ends)]
    assert part.commands.duration == pytest.approx(until - since)
    assert part.boundaries[0] == 0 and part.boundaries[-1] == ends[1] - ends[0]
    assert (np.diff(part.boundaries) >= 0).all()
    moments = np.arange(0.011, until - since, 0.05)
    np.testing.assert_array_equal(at(part, moments), at(whole, moments + since))
    np.testing.assert_array_equal(
        part.observed, whole.observed[slice(ends[0], ends[1] + 1)]
    )


def test_a_long_drive_by_hand_is_shortened():
    whole = driven(0.05, 601, seconds=300.0)
    ((part, begun),) = segments.shortened([whole], most=150.0, before=1.5)
    assert part.commands.duration == pytest.approx(150.0 + begun, abs=1.0)
    assert len(part.commands) == pytest.approx(20 * part.commands.duration, abs=2)
