"""From what was carried out and seen to a trial."""

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from bns.errors import BnsError
from bns.hardware.driving.motion import Performed
from bns.hardware.faults import Void
from bns.hardware.tracking.calibrate import askew
from bns.hardware.tracking.camera import Camera
from bns.hardware.tracking.tracker import Sighting
from bns.worlds.trial import Commands, Outcome, Trial

CLOSE = 1.2  # pictures: nearer to a change of command, recordings have no pose
ALONG = 5.0  # deg between the tag's edges and the camera's rows; see `trial`
GAP = 0.3  # s between two sightings beyond which nothing is filled in


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
    switched = np.array(done.switched)
    count = len(switched) - 1
    if count < 1:
        raise BnsError("No command was carried out.")
    moments = switched - switched[0]
    if recording is not None and count == len(commands):
        moments = np.concatenate([[0.0], np.cumsum(commands.durations)])
    grid = np.arange(0.0, moments[-1], sample_dt)
    apart = np.abs(grid[:, None] - moments).min(1) > 1e-3
    times = np.union1d(grid[apart], moments)
    poses = interpolated(done.sightings, times + switched[0])
    turns = np.rint((poses[0, 2] - start_yaw) / (2 * np.pi))
    if np.isfinite(turns):
        poses[:, 2] -= turns * 2 * np.pi
    boundaries = np.searchsorted(times, moments - 1e-9)
    lost = np.isnan(poses[:, 0])
    if lost.mean() > 0.3 or lost[boundaries].mean() > 0.3:
        raise Void(f"the robot was seen in {1 - lost.mean():.0%} of the samples")
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
