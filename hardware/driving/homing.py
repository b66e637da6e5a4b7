"""Taking the robot back to where a trial starts, by sight."""

from collections.abc import Sequence

import numpy as np

from bns.errors import BnsError
from bns.hardware.driving.motion import TICK, Mover
from bns.hardware.tracking.tracker import Sighting

CLOSE = 0.008  # m from the start that will do
TURNED = np.deg2rad(1.0)  # off the start's heading that will do
FACED = np.deg2rad(5.0)  # off a heading at the edge that will do; assumed
SLOW = 0.025  # m/s; below it the robot's speed control does not regulate well
TIME = 60.0  # s to get there
AXLE = 0.0874  # m, nominal


def go(
    mover: Mover,
    target: Sequence[float] | np.ndarray,
    *,
    speed: float = 0.10,
    lamps: np.ndarray | None = None,
    keep: float = 0.0,
) -> Sighting:
    """Drive to a pose and stop there.

    Closed loop: turn to the place, drive to it, then short turns with a look between
    them until the heading is right. Works with a weak wheel.

    Args:
        mover: of the robot.
        target: (x, y, yaw) in the world frame [m, m, rad].
        speed: largest [m/s].
        lamps: where lamps stand, ``(L, 2)`` [m]; None = nowhere.
        keep: distance to keep from them on the way [m].

    Returns:
        where it stands.

    Raises:
        SafetyStop: it was stopped.
        BnsError: it does not get there.
    """
    begin = mover.clock.now()
    try:
        seen = mover.wait_for_sight()
        if lamps is not None:
            for place in around(seen.pose[:2], target[:2], lamps, keep=keep):
                _approach(mover, place, speed, begin)
        while not _there(seen, target):
            if mover.clock.now() - begin > TIME:
                raise BnsError(
                    "The robot does not get back to the start: see that nothing is in "
                    "its way, or put it there by hand."
                )
            if _away(seen, target) > CLOSE:
                _approach(mover, target, speed, begin)
            mover.halt()
            seen = settled(mover)
            off = _wrapped(target[2] - seen.pose[2])
            if abs(off) > TURNED:
                _turn(mover, off)
                seen = settled(mover)
    finally:
        mover.halt()
    return seen


def face(mover: Mover, heading: float) -> Sighting:
    """Turn on the spot to a heading [rad] and stop there.

    Args:
        mover: of the robot.
        heading: in the world frame [rad].

    Raises:
        SafetyStop: it was stopped.
        BnsError: it does not turn.
    """
    begin = mover.clock.now()
    seen = settled(mover)
    while abs(off := _wrapped(heading - seen.pose[2])) > FACED:
        if mover.clock.now() - begin > TIME:
            raise BnsError(
                "The robot does not turn: see that nothing is in its way, or turn it "
                "by hand."
            )
        _turn(mover, off)
        seen = settled(mover)
    return seen


def _approach(
    mover: Mover, target: Sequence[float] | np.ndarray, speed: float, begin: float
) -> None:
    """Steer to the place until it is near, or was passed by."""
    best, back = np.inf, None
    while mover.clock.now() - begin < TIME:
        mover.look()
        seen = mover.last
        if seen is None:
            return
        gap = np.asarray(target[:2]) - seen.pose[:2]
        away = float(np.hypot(*gap))
        best = min(best, away)
        if away < 0.7 * CLOSE or (away > best + 0.01 and best < 0.03):
            return
        off = _wrapped(np.arctan2(gap[1], gap[0]) - seen.pose[2])
        if back is None:  # near: rather backwards than turn round
            back = abs(off) > np.pi / 2 and away < 0.15
        if back:
            off = _wrapped(off + np.pi)
        ahead = float(np.clip(1.2 * away, SLOW, speed)) * max(np.cos(off), 0.0) ** 3
        turn = float(np.clip(1.8 * off, -1.6, 1.6)) * AXLE / 2
        ahead = -ahead if back else ahead
        pair = np.array([ahead - turn, ahead + turn])
        pair *= min(1.0, speed / max(np.abs(pair).max(), 1e-9))
        now = mover.clock.now()
        mover.drive(float(pair[0]), float(pair[1]), times=1)
        mover.clock.sleep(TICK - (mover.clock.now() - now))


def _turn(mover: Mover, off: float) -> None:
    """A turn on the spot by about `off` [rad], then stop."""
    rate = 2 * SLOW / AXLE if abs(off) < 0.5 else 2 * 0.06 / AXLE
    wheel = rate * AXLE / 2 * np.sign(off)
    until = mover.clock.now() + abs(off) / rate
    mover.drive(-float(wheel), float(wheel), times=1)
    while (left := until - mover.clock.now()) > 0.002:
        mover.look()
        mover.clock.sleep(min(TICK, left))
    mover.halt()


def settled(mover: Mover) -> Sighting:
    """Where it stands: the mean of a few sightings at rest."""
    mover.clock.sleep(0.15)
    begin, seen = mover.clock.now(), []
    first = mover.wait_for_sight()
    seen.append(first)
    while len(seen) < 3 and mover.clock.now() - begin < 1.0:
        seen += [s for s in mover.look() if s.time >= begin]
        mover.clock.sleep(TICK)
    pose = np.mean([s.pose for s in seen], axis=0)
    return seen[-1]._replace(pose=pose)


def _there(seen: Sighting, target: Sequence[float] | np.ndarray) -> bool:
    turned = abs(_wrapped(target[2] - seen.pose[2]))
    return _away(seen, target) <= CLOSE and turned <= TURNED


def _away(seen: Sighting, target: Sequence[float] | np.ndarray) -> float:
    return float(np.hypot(target[0] - seen.pose[0], target[1] - seen.pose[1]))


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


WIDER = 1.25  # share of the distance to keep at which the way turns; assumed
CORNERS = 8  # at most


def around(
    begin: np.ndarray,
    end: Sequence[float] | np.ndarray,
    lamps: np.ndarray,
    *,
    keep: float,
) -> list[np.ndarray]:
    """Places to pass on the way from one place to another.

    A straight way that comes nearer than `keep` to a lamp gets a corner beside it; a
    way that begins nearer leads straight away from the lamp first.

    Args:
        begin, end: of the way, ``(2,)`` [m]; the end no nearer to a lamp than `keep`.
        lamps: where they stand, ``(L, 2)`` [m].
        keep: distance to keep [m].

    Returns:
        Corners ``(2,)`` [m] in order, without begin and end.
    """
    here, goal = np.array(begin, float), np.asarray(end, float)
    made: list[np.ndarray] = []
    while len(made) < CORNERS:
        lamp = _nearest(here, goal, lamps, keep)
        if lamp is None:
            break
        here = _beside(here, goal, lamp, keep)
        made.append(here)
    return made


def _nearest(
    here: np.ndarray, goal: np.ndarray, lamps: np.ndarray, keep: float
) -> np.ndarray | None:
    """The first lamp that the straight way comes too near to, if any."""
    way = goal - here
    length = max(float(way @ way), 1e-12)
    at = np.clip((lamps - here) @ way / length, 0.0, 1.0)
    apart = np.hypot(*(here + at[:, None] * way - lamps).T)
    near = np.flatnonzero(apart < keep * (1 - 1e-9))
    return lamps[near[at[near].argmin()]] if len(near) else None


def _beside(
    here: np.ndarray, goal: np.ndarray, lamp: np.ndarray, keep: float
) -> np.ndarray:
    """A corner that leads out of a lamp's reach, or some way round it."""
    out = here - lamp
    far = float(np.hypot(*out))
    if far < keep:  # straight away from it
        ahead = out / far if far > 1e-9 else np.array([1.0, 0.0])
        return lamp + WIDER * keep * ahead
    angle = np.arctan2(out[1], out[0])
    aim = np.arctan2(goal[1] - lamp[1], goal[0] - lamp[0])
    off = (aim - angle + np.pi) % (2 * np.pi) - np.pi
    turn = np.sign(off) * min(abs(off), np.pi / 3)
    return lamp + WIDER * keep * np.array([np.cos(angle + turn), np.sin(angle + turn)])
