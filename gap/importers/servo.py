"""What readers of servo recordings share: channels, and a trial from columns."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.worlds.data import dataset_checks as checks
from bns.worlds.trial import Channel, Commands, Trial

GOAL_CHANNELS = (Channel("goal", "rad"), Channel("torque_on", "1"))
ROBOT = "servo_pendulum"
SPIKE = 0.3  # [rad] assumed: a servo turns less than 0.1 rad in three samples of 10 ms
SPARE_BITS = 1 << 16  # an int16 that was read as unsigned is this much too large


def signed(raw: np.ndarray) -> np.ndarray:
    """Undo the wrap of 16-bit numbers stored as unsigned: 65535 is -1. Any shape."""
    raw = np.asarray(raw, dtype=np.float64)
    return np.where(raw >= SPARE_BITS // 2, raw - SPARE_BITS, raw)


def despiked(angle: np.ndarray) -> tuple[np.ndarray, int]:
    """Angles with lone wrong samples replaced, and how many they were.

    A packet that was lost reads as raw 0, for a single sample: more than `SPIKE` from
    the median of its seven neighbours, which no servo does. It becomes the mean of its
    good neighbours.

    Args:
        angle: samples, ``(T,)`` [rad].

    Returns:
        the mended angles, ``(T,)``; how many were replaced.
    """
    angle = np.asarray(angle, dtype=np.float64)
    if not len(angle):
        return angle, 0
    near = np.lib.stride_tricks.sliding_window_view(np.pad(angle, 3, mode="edge"), 7)
    wrong = np.abs(angle - np.median(near, axis=1)) > SPIKE
    if not wrong.any() or wrong.all():
        return angle, 0
    index = np.arange(len(angle))
    mended = np.where(wrong, np.interp(index, index[~wrong], angle[~wrong]), angle)
    return mended, int(wrong.sum())


def trial(
    columns: Mapping[str, np.ndarray],
    channels: tuple[Channel, ...],
    *,
    conditions: Mapping[str, object],
    where: str,
) -> Trial:
    """A trial from columns of samples.

    Args:
        columns: `time`, `goal`, `torque_on` and each observed channel, shape ``(T,)``.
        channels: what was observed; `angle` has to be among them.
        conditions: what is known of the run (mass, lever, gain, ...).
        where: file and run, for messages.

    Raises:
        FormatError: fewer than two samples, NaN, or time not going forward.
    """
    times = np.asarray(columns["time"], dtype=np.float64)
    if len(times) < 2:
        raise FormatError(
            f"{where} has {len(times)} samples; a run needs two at least."
        )
    wanted = ("time", "goal", "torque_on", *(channel.name for channel in channels))
    for name in wanted:
        if not np.isfinite(columns[name]).all():
            raise FormatError(f"{where}: {name} holds NaN or infinity.")
    held = np.diff(times)
    if not (held > 0).all():
        at = int(np.argmin(held))
        raise FormatError(f"{where}: time does not go forward at sample {at + 1}.")
    for name in wanted:
        most = np.abs(columns[name]).max()
        if most > (checks.LONGEST * 10 if name == "time" else checks.STRONGEST):
            raise FormatError(f"{where}: {name} reaches {most:.3g}, which nothing can.")
    told = np.stack([columns["goal"], columns["torque_on"]], axis=1)
    return Trial(
        commands=Commands(told[:-1], held, GOAL_CHANNELS),
        times=times - times[0],
        observed=np.stack([columns[channel.name] for channel in channels], axis=1),
        boundaries=np.arange(len(times)),
        channels=channels,
        robot=ROBOT,
        world="recording",
        conditions=dict(conditions),
    )


def directory(path: str | Path, *files: str) -> Path:
    """The directory, if it holds the files.

    Raises:
        FormatError: it is none, or a file is missing.
    """
    path = Path(path)
    missing = [file for file in files if not (path / file).exists()]
    if missing:
        raise FormatError(
            f"{path} holds no {missing[0]}: give the directory of the recordings; it "
            f"needs {', '.join(files)}."
        )
    return path
