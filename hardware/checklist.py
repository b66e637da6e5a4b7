"""What there is to see before a Khepera III is let go, one line each."""

from collections.abc import Iterator
from statistics import median

import numpy as np

from bns.hardware.driving import homing
from bns.hardware.driving.motion import Point
from bns.hardware.rig import Rig, battery

ENOUGH = 12.0  # pictures a second, so that one that is late stops no robot
PICTURES = 20  # looked at for rate and scatter


def report(rig: Rig, *, move: bool = False) -> Iterator[str]:
    """Check after check as a line.

    Args:
        rig: connected.
        move: turn and drive a little as well.

    Raises:
        BnsError: what is wrong; nothing has moved without `move`.
    """
    robot = rig.robot
    yield f"firmware   {robot.version[0]}.{robot.version[1]}, {robot.units.name}"
    yield f"battery    {battery(robot, rig.limits):.1f} V"
    trips = _trips(rig)
    yield (
        f"link       {median(trips) * 1e3:.1f} ms a round trip, worst of {len(trips)}: "
        f"{max(trips) * 1e3:.1f} ms; {len(rig.faults)} faults"
    )
    yield f"wheels     speeds {robot.speeds()}, positions {robot.positions()}"
    yield f"proximity  {robot.proximity()}"
    yield f"ambient    {robot.ambient()}"
    yield from _tracking(rig)
    yield "watchdog   running" if rig.watchdog else "watchdog   none (virtual time)"
    if move:
        yield from _motion(rig)


def _trips(rig: Rig) -> list[float]:
    for _ in range(30):
        rig.robot.speeds()
    return rig.robot.round_trips[-30:]


def _tracking(rig: Rig) -> Iterator[str]:
    mover = rig.mover()
    seen = [mover.wait_for_sight()]
    begin = rig.clock.now()
    while len(seen) < PICTURES and rig.clock.now() - begin < 10:
        seen += mover.look()
        rig.clock.sleep(0.02)
    poses = np.array([s.pose for s in seen])
    spread = poses.std(0) * [1e3, 1e3, np.degrees(1)]
    rate = (len(seen) - 1) / max(seen[-1].time - seen[0].time, 1e-9)
    late = rig.clock.now() - seen[-1].time
    x, y, yaw = poses.mean(0)
    yield (
        f"tag        at {x:.3f}, {y:.3f} m, {np.degrees(yaw):.1f} deg; scatter "
        f"{max(spread[:2]):.2f} mm, {spread[2]:.2f} deg"
    )
    slow = "; TOO FEW: a moving robot must be seen every 0.15 s" * (rate < ENOUGH)
    yield f"camera     {rate:.1f} pictures a second, {late * 1e3:.0f} ms old{slow}"


def _motion(rig: Rig) -> Iterator[str]:
    """A short drive forward and back, compared with wheels and tag."""
    mover, robot = rig.mover(), rig.robot
    with rig.operator:
        stand = mover.wait_for_sight()
        before = robot.positions()
        mover.perform([Point(0.0, 0.06, 0.06, 0)], 1.5)
        after, seen = robot.positions(), mover.wait_for_sight()
        wheels = [
            robot.units.distance(b - a) for a, b in zip(before, after, strict=True)
        ]
        gone = seen.pose[:2] - stand.pose[:2]
        ahead = gone @ [np.cos(stand.pose[2]), np.sin(stand.pose[2])]
        yield (
            f"drive      wheels {wheels[0] * 1e3:.1f} and {wheels[1] * 1e3:.1f} mm, "
            f"tag {ahead * 1e3:.1f} mm ahead"
        )
        if ahead < 0.02:
            yield "drive      WRONG: the tag is turned, or the wheels are swapped"
        homing.go(mover, stand.pose)
        yield "drive      back where it was"
