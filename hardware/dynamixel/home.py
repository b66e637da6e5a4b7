"""Taking a hexapod back to where a trial starts, by sight, in small tripod steps.

Three legs swing while the other three push, in any direction and with any turn, so it
walks straight to the place without turning round first.
"""

from collections.abc import Sequence

import numpy as np

from bns.errors import BnsError
from bns.hardware.dynamixel.walker import Walker
from bns.hardware.tracking.tracker import Sighting
from bns.models import robot
from bns.models.phantomx import kinematics
from bns.models.phantomx.gait import ONE_SET

CLOSE = 0.04  # m from the start that will do
TURNED = np.deg2rad(8.0)  # off the start's heading that will do
STRIDE, TURN = 0.09, np.deg2rad(18.0)  # largest way and turn of a step
LIFT = 0.04  # m of a swinging foot
REACH, HEIGHT = 0.13, 0.12  # m of the feet from the hips, of the hips above them
TIME = 90.0  # s to get there
STEP = 2.0  # s, longest time of half a step


def go(walker: Walker, target: Sequence[float]) -> Sighting:
    """Walk to a pose and stand there.

    Args:
        walker: of the robot.
        target: (x, y, yaw) in the world frame [m, m, rad].

    Raises:
        SafetyStop: it was stopped.
        BnsError: it does not get there.
    """
    walker.rise()
    begin, swing = walker.clock.now(), ONE_SET
    seen = _halfway(walker)
    while not _there(seen, target):
        if walker.clock.now() - begin > TIME:
            walker.halt()
            raise BnsError(
                "The robot does not get back to the start: see that nothing is in its "
                "way, or put it there by hand."
            )
        _put(walker, _stance())
        for _ in range(_steps(seen, target)):
            _step(walker, swing, target)
            swing = ~swing
        seen = _halfway(walker)
    return seen


def _steps(seen: Sighting, target: Sequence[float]) -> int:
    """Steps until it should be there, at most a few before the feet are put right."""
    gap, turn = _gap(seen.pose, target)
    need = max(np.hypot(*gap) / STRIDE, abs(turn) / TURN)
    return int(np.clip(np.ceil(need), 1, 8))


def _step(walker: Walker, swing: np.ndarray, target: Sequence[float]) -> None:
    """One step towards the target as it is seen now."""
    gap, turn = _gap((walker.last or walker.wait_for_sight()).pose, target)
    away = float(np.hypot(*gap))
    way = gap * min(1.0, STRIDE / max(away, 1e-9))
    turn = float(np.clip(turn, -TURN, TURN))
    feet = _stance()
    ahead, behind = _moved(feet, way / 2, turn / 2), _moved(feet, -way / 2, -turn / 2)
    placed = np.where(swing[:, None], ahead, behind)
    raised = placed + np.column_stack([np.zeros((6, 2)), LIFT * swing])
    for each in (raised, placed):
        walker.go(_inside(each), STEP, wait=False)


def _halfway(walker: Walker) -> Sighting:
    """Stand with all servos half-way; where it then is."""
    if np.abs(walker.goals).max() > 1e-6:
        _put(walker, kinematics.feet(np.zeros(18)))
    walker.go(np.zeros(18), STEP)
    return walker.wait_for_sight()


def _put(walker: Walker, feet: np.ndarray) -> None:
    """Put the feet somewhere else, one tripod after the other."""
    now = kinematics.feet(walker.goals)
    for up in (ONE_SET, ~ONE_SET):
        lifted = np.where(up[:, None], feet + np.array([0, 0, LIFT]), now)
        walker.go(_inside(lifted), STEP, wait=False)
        now = np.where(up[:, None], feet, now)
        walker.go(_inside(now), STEP, wait=False)


def _stance() -> np.ndarray:
    """Feet in mid-stride, ``(6, 3)`` [m]."""
    s = kinematics.shape()
    out = np.column_stack([np.sin(s.heading), s.side * np.cos(s.heading)])
    return np.column_stack([s.hips + REACH * out, np.full(6, -HEIGHT)])


def _inside(feet: np.ndarray) -> np.ndarray:
    """Goals for feet, kept between the end stops."""
    low, high = robot("phantomx").ranges.T
    return np.clip(kinematics.goals(feet), low, high)


def _moved(feet: np.ndarray, way: np.ndarray, turn: float) -> np.ndarray:
    """Feet after the body's frame is moved by a way and a turn, shape ``(6, 3)``."""
    cos, sin = np.cos(turn), np.sin(turn)
    flat = feet[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + way
    return np.column_stack([flat, feet[:, 2]])


def _gap(pose: np.ndarray, target: Sequence[float]) -> tuple[np.ndarray, float]:
    """Way to the target in the robot's frame [m], and the turn [rad]."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    gap = np.array([[cos, sin], [-sin, cos]]) @ (np.asarray(target[:2]) - pose[:2])
    return gap, float((target[2] - pose[2] + np.pi) % (2 * np.pi) - np.pi)


def _there(seen: Sighting, target: Sequence[float]) -> bool:
    gap, turn = _gap(seen.pose, target)
    return float(np.hypot(*gap)) <= CLOSE and abs(turn) <= TURNED
