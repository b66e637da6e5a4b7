"""The hardware world on an emulated robot, line, camera and tracker in virtual time."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.worlds.trial import Commands
from bns.worlds.world import clear, ring

pytest.importorskip("cv2")

from bns.hardware.emulators import virtual
from bns.hardware.faults import SafetyStop
from bns.hardware.worlds.wheeled import HardwareWorld

AHEAD = Commands([[0.1, 0.1], [0.06, -0.06]], [1.0, 0.8])


@pytest.fixture(scope="module")
def trial():
    """A trial, and the rig it was run on."""
    rig = virtual.rig(start=(0.02, 0.01, 0.1))
    world = HardwareWorld(rig=rig, damage=["wheel_gain:wheel=left,factor=0.5@1"])
    return world.run([AHEAD])[0], rig, world


def test_a_trial_tells_what_the_robot_did(trial):
    seen, rig, world = trial
    begin = next(at for at, *units in rig.device.log if units == [14401, 14401])
    for at, pose in zip(
        seen.times[seen.boundaries], seen.command_poses_world, strict=True
    ):
        true = rig.body.pose(begin + at)
        assert np.hypot(*(pose - true)[:2]) < 0.004
        assert abs(pose[2] - true[2]) < 0.05
    assert np.abs(seen.command_poses_world[0]).max() < 0.03  # it went to the start
    assert seen.commands.durations == pytest.approx(AHEAD.durations, abs=0.05)
    assert (seen.robot, seen.world) == ("khepera3", world.name)
    assert seen.conditions["voids"] == []
    assert max(map(abs, rig.body.wheel_speeds())) < 0.02


def test_software_damage_changes_what_is_sent_from_its_trial_on(trial):
    sound, rig, world = trial
    rig.device.log.clear()
    hit = world.run([AHEAD], trial=1)[0]
    assert any(row[1:] == (7200, 14401) for row in rig.device.log)
    turns = [np.ptp(item.poses_world[[0, -1], 2]) for item in (sound, hit)]
    assert turns[1] < turns[0] - 0.5  # the left wheel lags: less to the right
    assert hit.conditions["damage"] == ["wheel_gain:wheel=left,factor=0.5"]


def test_the_alarm_a_covered_camera_and_the_rim_stop_it(trial):
    _, rig, world = trial
    ring("the learner failed")
    with pytest.raises(SafetyStop, match="learner failed"):
        world.run([AHEAD])
    clear()
    rig.eyes.blind = True
    with pytest.raises(BnsError, match="not in view"):
        world.run([AHEAD])
    rig.eyes.blind = False
    edge = HardwareWorld(rig=rig, start=(0.0, 0.0, 0.0), arena=(0.5, 0.5))
    rig.limits = type(rig.limits)(arena=(0.5, 0.5))
    out = edge.run([Commands([[0.12, 0.12]] * 3, [1.5] * 3)])[0]
    assert out.outcome.left_arena and out.outcome.stopped
    assert len(out.commands) < 3
    assert max(map(abs, rig.body.wheel_speeds())) < 0.02


def test_what_cannot_be_is_refused_before_anything_moves():
    with pytest.raises(BnsError, match="give --port"):
        HardwareWorld().run([AHEAD])
    with pytest.raises(BnsError, match="There is no port /nowhere"):
        HardwareWorld(port="/nowhere").run([AHEAD])
    with pytest.raises(BnsError, match="one robot, not 2"):
        HardwareWorld(port="/nowhere").run([AHEAD, AHEAD])
    with pytest.raises(BnsError, match="cannot represent 'payload'"):
        HardwareWorld(damage=["payload:mass=0.1"])


def test_a_low_battery_is_refused():
    rig = virtual.rig()
    rig.device.battery = 6.1
    with pytest.raises(BnsError, match=r"6\.1 V, less than 7 V"):
        HardwareWorld(rig=rig).run([AHEAD])
    assert not rig.device.log
