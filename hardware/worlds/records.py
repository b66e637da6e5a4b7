"""From what was carried out and seen to a trial."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from bns.errors import BnsError
from bns.hardware.driving.motion import Performed
from bns.hardware.dynamixel.walker import Walked
from bns.hardware.faults import Void
from bns.hardware.tracking.calibrate import askew
from bns.hardware.tracking.camera import Camera
from bns.hardware.tracking.tracker import Sighting
from bns.worlds.trial import Channel, Commands, Outcome, Trial

CLOSE = 1.2  # pictures: nearer to a change of command, recordings have no pose
ALONG = 5.0  # deg between the tag's edges and the camera's rows; see `trial`
GAP = 0.3  # s between two sightings beyond which nothing is filled in
LATE = 0.25  # s by which a hexapod's frame may be late before its trial is void
BEHIND = 0.1  # s between the samples of its commands that were not reached


def trial(
    done: Performed,
    commands: Commands,
    *,
    sample_dt: float,
    start_yaw: float,
    robot: str,
    world: str,
    conditions: dict,
    recording: Camera | None = None,
) -> Trial:
    """The trial of commands that were carried out.

    The samples lie on a regular grid and at the moments at which commands changed;
    between two pictures the pose is interpolated. Commands that were not reached are
    left out, durations are those that the robot got. In a recording they are those
    that were told, so that repeats are alike: by how much each moment was off is then
    a scatter of the motion. And within a picture of a change of command there is no
    pose in it but the first: what is filled in there is wrong by some mrad. Nor is
    there one where the tag's edges lie along the camera's rows, within 5 deg: there
    the heading is found 3 mrad off, the same from picture to picture.

    Args:
        done: what happened.
        commands: what was wanted.
        sample_dt: time between samples [s].
        start_yaw: heading at the start [rad], for continuous yaws.
        robot, world, conditions: see `Trial`.
        recording: it is one, see above, of this camera. Where a trial was ended early
            the robot's own durations hold nevertheless.

    Raises:
        Void: too little was seen.
    """
    moments = _moments(done.switched)
    count = len(moments) - 1
    if recording is not None and count == len(commands):
        moments = np.concatenate([[0.0], np.cumsum(commands.durations)])
    times, boundaries = _samples(moments, sample_dt)
    poses = interpolated(done.sightings, times + done.switched[0])
    _continue(poses, start_yaw)
    _refuse_unseen(poses, boundaries)
    if recording is not None:
        along = [askew(Sighting(0.0, pose, 0.0), recording) < ALONG for pose in poses]
        poses[_near(times, moments, done.sightings) | along] = np.nan
    return Trial(
        commands=Commands(commands.values[:count], np.diff(moments), commands.channels),
        times=times,
        observed=poses,
        boundaries=boundaries,
        outcome=Outcome(left_arena=done.left, stopped=done.left),
        robot=robot,
        world=world,
        conditions=conditions,
    )


def _moments(switched: Sequence[float]) -> np.ndarray:
    """When commands changed, from the first on [s].

    Raises:
        BnsError: there was no command.
    """
    if len(switched) < 2:
        raise BnsError("No command was carried out.")
    return np.array(switched) - switched[0]


def _samples(moments: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Times of a regular grid and of the moments, and which of them those are."""
    grid = np.arange(0.0, moments[-1], dt)
    apart = np.abs(grid[:, None] - moments).min(1) > 1e-3
    times = np.union1d(grid[apart], moments)
    return times, np.searchsorted(times, moments - 1e-9)


def _continue(observed: np.ndarray, start_yaw: float) -> None:
    """Take whole turns from all yaws, so that the first is near the start's."""
    turns = np.rint((observed[0, 2] - start_yaw) / (2 * np.pi))
    if np.isfinite(turns):
        observed[:, 2] -= turns * 2 * np.pi


def _refuse_unseen(observed: np.ndarray, boundaries: np.ndarray) -> None:
    """Raise `Void` where too little was seen."""
    lost = np.isnan(observed[:, 0])
    if lost.mean() > 0.3 or lost[boundaries].mean() > 0.3:
        raise Void(f"the robot was seen in {1 - lost.mean():.0%} of the samples")


def _near(
    times: np.ndarray, moments: np.ndarray, sightings: list[Sighting]
) -> np.ndarray:
    """Which samples lie within a picture of a change of command, the first not."""
    apart = float(np.median(np.diff([sighting.time for sighting in sightings])))
    close = np.abs(times[:, None] - moments).min(1) < CLOSE * apart
    close[0] = False
    return close


def interpolated(sightings: list[Sighting], times: np.ndarray) -> np.ndarray:
    """Poses ``(T, 3)`` at some times [s], NaN where nothing was seen near them."""
    seen = np.array([s.time for s in sightings])
    order = np.unique(seen, return_index=True)[1]
    seen = seen[order]
    poses = np.array([sightings[i].pose for i in order])
    if len(seen) >= 5:
        made = Akima1DInterpolator(seen, poses)(np.clip(times, seen[0], seen[-1]))
    else:
        made = np.column_stack([np.interp(times, seen, column) for column in poses.T])
    after = np.searchsorted(seen, times)
    before = np.clip(after - 1, 0, len(seen) - 1)
    after = np.clip(after, 0, len(seen) - 1)
    width = np.where(after > before, seen[after] - seen[before], 0.0)
    outside = (times < seen[0] - 0.5) | (times > seen[-1] + 0.02)
    made[(width > GAP) | outside] = np.nan
    return made


def walked_trial(
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
    """The trial of commands that a hexapod carried out.

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
    moments = _moments(done.switched)
    times, boundaries = _samples(moments, sample_dt)
    observed = _observed(done, times + done.switched[0], boundaries, channels)
    _continue(observed, start_yaw)
    _refuse_unseen(observed, boundaries)
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
