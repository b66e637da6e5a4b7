"""From what a hexapod carried out and what was seen to a trial."""

import numpy as np

from bns.errors import BnsError
from bns.hardware.dynamixel.walker import Walked
from bns.hardware.faults import Void
from bns.hardware.worlds.records import GAP, interpolated
from bns.worlds.trial import Channel, Commands, Outcome, Trial

LATE = 0.25  # s by which a frame may be late before the trial is void
BEHIND = 0.1  # s between the samples of commands that were not reached


def trial(
    done: Walked,
    commands: Commands,
    *,
    sample_dt: float,
    start_yaw: float,
    robot: str,
    world: str,
    channels: tuple[Channel, ...],
    conditions: dict,
) -> Trial:
    """The trial of commands that were carried out.

    The samples lie on a regular grid and at the moments at which commands changed;
    what lies between pictures and between readings is interpolated. Where a command
    changes the robot rests: there the last picture and the last readings hold, as the
    next ones already show it moving. Commands that were not reached are there, with NaN
    as poses.

    Args:
        done: what happened.
        commands: what was wanted.
        sample_dt: time between samples [s].
        start_yaw: heading at the start [rad], for continuous yaws.
        robot, world, channels, conditions: see `Trial`.

    Raises:
        Void: too little was seen, or a frame came too late.
    """
    if done.late > LATE:
        raise Void(f"a frame was {done.late:.2f} s late")
    moments = np.array(done.switched) - done.switched[0]
    if len(moments) < 2:
        raise BnsError("No command was carried out.")
    grid = np.arange(0.0, moments[-1], sample_dt)
    apart = np.abs(grid[:, None] - moments).min(1) > 1e-3
    times = np.union1d(grid[apart], moments)
    boundaries = np.searchsorted(times, moments - 1e-9)
    observed = _observed(done, times + done.switched[0], boundaries, channels)
    turns = np.rint((observed[0, 2] - start_yaw) / (2 * np.pi))
    if np.isfinite(turns):
        observed[:, 2] -= turns * 2 * np.pi
    lost = np.isnan(observed[:, 0])
    if lost.mean() > 0.3 or lost[boundaries].mean() > 0.3:
        raise Void(f"the robot was seen in {1 - lost.mean():.0%} of the samples")
    short = len(commands) - (len(moments) - 1)
    times, observed, boundaries = _unreached(short, times, observed, boundaries)
    spans = np.diff(times[boundaries])
    return Trial(
        commands=Commands(commands.values, spans, commands.channels),
        times=times,
        observed=observed,
        boundaries=boundaries,
        channels=channels,
        outcome=Outcome(
            left_arena=done.left,
            fell=done.fell,
            stopped=done.left or done.overloaded or done.fell,
            overloaded=done.overloaded,
            unrested=done.unrested,
        ),
        robot=robot,
        world=world,
        conditions=conditions,
        handled=np.arange(len(commands)) >= len(commands) - short,
    )


def _unreached(
    count: int, times: np.ndarray, observed: np.ndarray, boundaries: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples with one more for each command that was not reached, NaN as observed."""
    later = times[-1] + BEHIND * np.arange(1, count + 1)
    unseen = np.full((count, observed.shape[1]), np.nan)
    return (
        np.append(times, later),
        np.vstack([observed, unseen]),
        np.append(boundaries, len(times) + np.arange(count)),
    )


def _observed(
    done: Walked,
    times: np.ndarray,
    resting: np.ndarray,
    channels: tuple[Channel, ...],
) -> np.ndarray:
    """Poses and joint angles at some times [s], ``(T, n_channels)``.

    Args:
        done: what happened.
        times: of the samples [s].
        resting: samples at which the robot rests.
        channels: of the samples.
    """
    poses = interpolated(done.sightings, times)
    seen = np.array([sighting.time for sighting in done.sightings])
    last = np.array([sighting.pose for sighting in done.sightings])
    poses[resting] = _held(seen, last, times[resting])
    columns = [poses]
    for channel in channels[3:]:
        read = done.readings.get(channel.name.removesuffix("_position"), [])
        if read:
            at, angle = np.array(read).T
            angles = np.interp(times, at, angle)
            angles[resting] = _held(at, angle[:, None], times[resting])[:, 0]
            columns.append(angles[:, None])
        else:
            columns.append(np.full((len(times), 1), np.nan))
    return np.hstack(columns)


def _held(at: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """The last of some rows at each time, the first before any; NaN where it is old."""
    last = np.maximum(np.searchsorted(at, times + 1e-6, side="right") - 1, 0)
    made = values[last].copy()
    made[times - at[last] > GAP] = np.nan
    return made
