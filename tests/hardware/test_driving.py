"""Driving: a camera that hangs stops the robot; sizes of wheels and axle are found.

A robot that drives is not taken to stand.
"""

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.hardware.driving import odometry
from bns.hardware.driving.odometry import Wheels, fit
from bns.hardware.emulators import run
from bns.hardware.faults import SafetyStop, Void
from bns.hardware.safety.motion_check import AXLE, SLOWEST, MotionCheck
from bns.hardware.tracking.tracker import Frame, Sighting, Tracker
from bns.hardware.worlds.wheeled import HardwareWorld
from bns.models.khepera3 import WHEEL_DIAMETER
from bns.worlds.trial import Commands

pytest.importorskip("cv2")

BOTH = np.ones(2)
ROUND = Commands([[0.04, 0.10]], [4.0])
STEP = 0.002  # s


def driven(rng, lag, delay, seconds=8.0):
    """A robot on wheels that lag: whether it was ever taken to stand."""
    check, pose, speed = MotionCheck(), np.zeros(3), np.zeros(2)
    goal, poses = np.zeros(2), []
    for step in range(round(seconds / STEP)):
        at = step * STEP
        if step % 150 == 0:  # every 0.3 s
            goal = rng.uniform(-0.15, 0.15, 2) * rng.choice([0.1, 1.0])
            check.told(at, *goal)
        speed += (goal - speed) * STEP / lag
        left, right = speed * STEP
        turn = (right - left) / AXLE
        ahead, heading = (left + right) / 2, pose[2] + turn / 2
        way = np.array([ahead * np.cos(heading), ahead * np.sin(heading), turn])
        pose = pose + way
        poses.append(pose)
        if step % 17 == 0:
            shown = poses[max(step - round(delay / STEP), 0)]
            noise = rng.normal(0, [4e-5, 4e-5, 5e-4])
            if check.stands(Sighting(at, shown + noise, 0.08), BOTH):
                return True
    return False


@pytest.mark.parametrize("lag", [0.05, 0.13, 0.25])
@pytest.mark.parametrize("delay", [0.0, 0.08])
def test_a_robot_that_drives_is_never_taken_to_stand(lag, delay):
    rng = np.random.default_rng([int(1000 * lag), int(100 * delay)])
    assert not any(driven(rng, lag, delay) for _ in range(4))


@pytest.mark.parametrize("speed, within", [(0.1, 0.08), (0.03, 0.12), (0.016, 0.2)])
def test_a_pose_that_stays_shows_soon(speed, within):
    check = MotionCheck()
    check.told(0.0, speed, speed)
    frames = np.arange(0.5, 3.0, 1 / 30)
    stood = []
    for at in frames:
        x = speed * (min(at, 2.0) - 0.13)
        if check.stands(Sighting(at, np.array([x, 0.0, 0.0]), 0.08), BOTH):
            stood.append(at)
    assert 2.0 < stood[0] < 2.0 + within


def test_what_need_not_move_is_left_alone():
    for left, right, shares in (
        (0.9 * SLOWEST, 0.0, BOTH),  # slower than it regulates
        (0.1, 0.0, np.array([0.0, 1.0])),  # the wheel is known to be dead
        (0.0, 0.0, BOTH),
    ):
        check = MotionCheck()
        check.told(0.0, left, right)
        assert not any(
            check.stands(Sighting(at, np.zeros(3), 0.08), shares)
            for at in np.arange(0.0, 3.0, 0.1)
        )


def test_a_picture_that_comes_again_is_marked():
    rig = run.rig()
    image = rig.eyes.source.paint_at(0.1)
    tracker = Tracker(rig.eyes.tracker.camera, rig.eyes.tracker.marker)
    first, again = (tracker.see(Frame(at, image, 0)) for at in (0.1, 0.2))
    other = tracker.see(Frame(0.3, rig.eyes.source.paint_at(0.3), 2))
    assert [s.repeated for s in (first, again, other)] == [False, True, False]


def hanging(rig, way):
    """Let its camera hang, once the robot has driven for half a second; when it did."""
    broken = {"at": 0.0}
    paint, poll = rig.eyes.source.paint_at, rig.eyes.poll

    def hangs():
        told = rig.device.log[-1][1:] if rig.device.log else ()
        driven = told == (5760, 14401) and rig.device.log[-1][0] + 0.5
        if not broken["at"] and driven and rig.clock.now() > driven:
            broken["at"] = rig.clock.now()
            broken["image"] = paint(broken["at"])
        return broken["at"]

    def painted(at):
        if hangs() and way == "frozen":
            return broken["image"]
        return paint(broken["at"] if hangs() and way == "stuck" else at)

    def polled():
        seen = poll()
        if hangs() and way == "stale":
            return [s._replace(time=min(s.time, broken["at"])) for s in seen]
        if hangs() and way == "ahead":
            return [s._replace(time=s.time + 3600) for s in seen]
        return seen

    rig.eyes.source.paint_at, rig.eyes.poll = painted, polled
    return broken


@pytest.mark.parametrize("way", ["frozen", "stuck", "stale", "ahead"])
def test_a_camera_that_hangs_stops_the_robot_in_time(way, monkeypatch):
    if way == "frozen":  # a repeated picture is no sighting, whatever it shows
        monkeypatch.setattr(MotionCheck, "stands", lambda *words: False)
    rig = run.rig(rate=30.0)
    broken, world = hanging(rig, way), HardwareWorld(rig=rig)
    with pytest.raises(Void):
        world._once(rig, ROUND, world._stages(4.0, 0, ())[0], 0, 0)
    stops = [at for at in rig.device.stops if at > broken["at"] > 0]
    assert stops[0] - broken["at"] < 0.2
    assert max(map(abs, rig.body.wheel_speeds())) < 0.02
    if way in ("frozen", "stale", "ahead"):  # nor does it begin to move again
        told = len(rig.device.log)
        with pytest.raises(BnsError, match="not in view"):
            world.run([ROUND])
        assert all(row[1:] == (0, 0) for row in list(rig.device.log)[told:])


def test_a_picture_that_stays_stuck_ends_the_session_and_each_try_begins_at_rest(
    monkeypatch,
):
    """A standing robot looks the same: that it is stuck shows only once it drives."""
    rig = run.rig(rate=30.0)
    speeds, drive = [], rig.robot.drive

    def driven(left, right, **words):
        if (left or right) and rig.device.log and rig.device.log[-1][1:] == (0, 0):
            speeds.append(max(map(abs, rig.body.wheel_speeds())))
        return drive(left, right, **words)

    monkeypatch.setattr(rig.robot, "drive", driven)
    hanging(rig, "stuck")
    world = HardwareWorld(rig=rig)
    with pytest.raises(SafetyStop, match="see that the camera works"):
        world.run([ROUND])
    assert world.voids == 1
    assert speeds and max(speeds) < 0.005


def test_a_robot_that_is_held_is_no_hanging_camera():
    dead = ["wheel_gain:wheel=left,factor=0", "wheel_gain:wheel=right,factor=0"]
    rig = run.rig(dead)
    (trial,) = HardwareWorld(rig=rig).run([Commands([[0.1, 0.1]], [1.5])])
    assert np.ptp(trial.poses_world[:, 0]) < 0.002
    assert rig.faults.counts["stands"] >= 1


def moved(left, right, *, sizes, axle):
    """Motion of drives with constant speeds, ``(N, 3)``."""
    way = (sizes[0] * left + sizes[1] * right) / 2
    turn = (sizes[1] * right - sizes[0] * left) / axle
    chord = way * np.sinc(turn / (2 * np.pi))
    return np.column_stack([chord * np.cos(turn / 2), chord * np.sin(turn / 2), turn])


def ways():
    table = np.array(odometry.DRIVES)
    return table[:, :2] * table[:, 2:]


def test_known_sizes_are_found_and_kept(tmp_path):
    given = ways()
    seen = moved(*given.T, sizes=(1.02, 0.99), axle=0.0850)
    seen += np.random.default_rng(3).normal(0, [2e-4, 2e-4, 1e-3], seen.shape)
    found = fit(given, seen)
    assert found.factors == pytest.approx((1.02, 0.99), abs=2e-3)
    assert found.axle == pytest.approx(0.0850, abs=2e-4)
    assert 0 < found.error[0] < 1e-4
    found.write(tmp_path / "wheels.json")
    assert Wheels.read(tmp_path / "wheels.json") == found


def test_a_robot_that_is_none_is_refused(tmp_path):
    with pytest.raises(BnsError, match="off nominal"):
        fit(ways(), moved(*ways().T, sizes=(1.3, 1.3), axle=0.088))
    with pytest.raises(BnsError, match="four"):
        fit(ways()[:2], np.zeros((2, 3)))
    Wheels(left=2 * WHEEL_DIAMETER, right=WHEEL_DIAMETER, axle=0.088).write(
        tmp_path / "odd.json"
    )
    for name, words in (("odd.json", "nominal size"), ("none.json", "cannot be read")):
        with pytest.raises(FormatError, match=words):
            Wheels.read(tmp_path / name)


@pytest.mark.parametrize("change", ['"axle": 0', '"axle": NaN', '"left": "wide"'])
def test_wheels_that_cannot_be_are_refused(tmp_path, change):
    text = '{"format": "bns-wheels", "left": 0.041, "right": 0.041, "axle": 0.0884,'
    text += f' "error": [0, 0, 0], {change}}}'
    (tmp_path / "wheels.json").write_text(text)
    with pytest.raises(FormatError, match=r"wheels\.json"):
        Wheels.read(tmp_path / "wheels.json")
