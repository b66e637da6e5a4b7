"""The hardware world on an emulated robot, line, camera and tracker in virtual time.

Set points that a line spoils are put right or make a trial void; damage does not. With
a lamp on the board the robot steers itself, is watched, and learns.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from bns.errors import BnsError
from bns.hardware.driving import homing
from bns.hardware.emulators import run
from bns.hardware.faults import SafetyStop
from bns.hardware.worlds.real_robot import TRIES
from bns.hardware.worlds.wheeled import HardwareLight, HardwareWorld
from bns.worlds.light import sensors as light_sensors
from bns.worlds.light.law import Lamp
from bns.worlds.trial import Commands
from bns.worlds.world import clear, ring

pytest.importorskip("cv2")


AHEAD = Commands([[0.1, 0.1], [0.06, -0.06]], [1.0, 0.8])


@pytest.fixture(scope="module")
def trial():
    """A trial, and the rig it was run on."""
    rig = run.rig(start=(0.02, 0.01, 0.1))
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
    rig = run.rig()
    rig.device.battery = 6.1
    with pytest.raises(BnsError, match=r"6\.1 V, less than 7 V"):
        HardwareWorld(rig=rig).run([AHEAD])
    assert not rig.device.log


LONG = Commands([[0.12, 0.11], [-0.10, -0.12]], [2.4, 2.2])


class Spoilt:
    """A device that hears another number instead of one, so many times."""

    def __init__(self, device, heard, instead, times):
        self.device, self.heard, self.instead = device, heard, instead
        self.times = times

    def receive(self, data, now):
        if self.heard in data and self.times:
            self.times -= 1
            data = data.replace(self.heard, self.instead)
        return self.device.receive(data, now)

    def advance(self, now):
        self.device.advance(now)


def spoilt(rig, told, instead, times):
    """The rig, its line spoiling some set points and (so it seems) some answers."""
    units = round(rig.robot.units.units(told))
    words = f"l{units},".encode(), f"l{round(rig.robot.units.units(instead))},".encode()
    rig.line.device = Spoilt(rig.line.device, *words, times)
    for _ in range(10):  # else the line is not suspected
        rig.faults.note("garbled answer")
    return rig


def test_a_set_point_that_was_spoilt_is_sent_again_and_the_trial_is_void():
    rig = spoilt(run.rig(), 0.12, 0.02, 2)
    (trial,) = HardwareWorld(rig=rig).run([LONG])
    assert rig.faults.counts["wheels not as told"] >= 1
    assert (
        len(trial.conditions["voids"]) == 1 and "astray" in trial.conditions["voids"][0]
    )
    told = [row[1:] for row in rig.device.log]
    wrong = told.index((2880, 15841))
    assert (17281, 15841) in told[wrong:]


class Unanswered(Spoilt):
    """A device whose answers to a number are lost, so many times."""

    def receive(self, data, now):
        answer = self.device.receive(data, now)
        if self.heard in data and self.times:
            self.times -= 1
            return type(answer)()
        return answer


def test_a_first_set_point_that_may_have_held_before_makes_the_trial_void():
    rig = run.rig()
    world = HardwareWorld(rig=rig)
    world.run([LONG])  # from then on it is known how soon answers come
    units = round(rig.robot.units.units(0.12))
    rig.line.device = Unanswered(rig.line.device, f"l{units},".encode(), b"", 1)
    (trial,) = world.run([LONG], trial=1)
    (why,) = trial.conditions["voids"]
    assert "the first command had to be sent again" in why
    began = [row[0] for row in rig.device.log if row[1] == units]
    assert trial.conditions["first"] == pytest.approx(
        min(moment for moment in began if moment > trial.conditions["began"]), abs=0.05
    )


@pytest.mark.parametrize("suspected", [False, True])
def test_a_damaged_wheel_is_learned_and_not_taken_for_the_line(suspected):
    rig = run.rig(["wheel_gain:wheel=left,factor=0.6"])
    for _ in range(10 * suspected):
        rig.faults.note("garbled answer")
    world = HardwareWorld(rig=rig)
    (trial,) = world.run([LONG])
    assert trial.conditions["notes"] == ["a wheel does not follow its set point"]
    assert world.voids <= 1 < TRIES
    if suspected:
        assert rig.following.shares == pytest.approx([0.6, 1.0], abs=0.06)
    before = rig.faults.counts["wheels not as told"]
    (again,) = world.run([LONG], trial=1)
    assert rig.faults.counts["wheels not as told"] == before
    assert np.isfinite(again.poses_world).all()


LAMP = Lamp()


class Fixed:
    """A controller that always gives the same command, and keeps what it saw."""

    def __init__(self, left, right):
        self.pair, self.seen = (left, right), []

    def memory(self, n):
        return np.zeros((n, 0))

    def act(self, readings, memory):
        self.seen.append(readings[0].copy())
        return np.array([self.pair]), memory


def drive(policy, start, *, cycles=12, **settings):
    rig = run.rig(lights=(LAMP,), start=(start[0], start[1], start[2] + 0.3))
    world = HardwareLight(rig=rig, lights=[LAMP], **settings)
    (trial,) = world.drive(policy, cycles=cycles, starts=np.array([start]))
    return trial, rig


def test_at_the_lamp_it_is_stopped_for_good():
    trial, rig = drive(Fixed(0.12, 0.12), (-0.6, 0.0, 0.0))
    end = np.hypot(*trial.poses_world[-1, :2])
    assert trial.outcome.stopped and trial.outcome.lamp_stops == 1
    assert rig.limits.lamp < end < 0.15
    first = int(np.flatnonzero(trial.handled)[0])
    assert 7 <= first <= 10 and trial.handled[first:].all()
    assert not trial.commands.values[first + 1 :].any()
    assert np.hypot(*rig.body.pose()[:2]) == pytest.approx(end, abs=2e-3)


def test_at_the_edge_it_is_turned_to_the_centre_and_goes_on():
    trial, _ = drive(Fixed(0.12, 0.12), (-1.1, 0.3, np.pi), cycles=10)
    (turned,) = np.flatnonzero(trial.handled)
    assert trial.outcome.edge_turns == 1 and not trial.outcome.stopped
    poses = trial.poses_world[trial.boundaries]
    to_centre = np.arctan2(-poses[turned + 1, 1], -poses[turned + 1, 0])
    off = (poses[turned + 1, 2] - to_centre + np.pi) % (2 * np.pi) - np.pi
    assert abs(off) < np.pi / 4 + 0.1
    assert np.hypot(*poses[-1, :2]) < np.hypot(*poses[turned + 1, :2]) - 0.05
    assert np.diff(trial.times[trial.boundaries]) == pytest.approx(0.4, abs=0.02)


def test_what_it_reads_is_the_light_where_it_is():
    policy = Fixed(0.06, 0.05)
    trial, _ = drive(policy, (-0.8, 0.4, -0.4), cycles=8)
    poses = trial.poses_world[trial.boundaries]
    sensors = light_sensors.of("khepera3")
    due = sensors.virtual(sensors.counts(_field(), poses))[:-1]
    assert np.abs(np.array(policy.seen) - due).mean() < 0.05 * 4095
    assert np.ptp(due) > 0.2 * 4095  # it matters where it is
    read = np.stack([trial.channel(n) for n in ("light_left", "light_right")], 1)
    assert read[trial.boundaries[:-1]] == pytest.approx(np.array(policy.seen))


def test_software_damage_changes_readings_and_commands():
    policy = Fixed(0.1, 0.1)
    hurt = ["sensor_stuck_min:sensor=left,blend=1", "wheel_gain:wheel=left,factor=0.5"]
    trial, _ = drive(policy, (-1.0, 0.5, 0.0), cycles=6, damage=hurt)
    assert not np.array(policy.seen)[:, 0].any() and policy.seen[0][1] > 100
    assert trial.poses_world[-1, 2] > 0.5  # the left wheel is the slower one
    assert trial.commands.values == pytest.approx(0.1)


def test_ways_lead_round_lamps():
    lamps = np.zeros((1, 2))
    for begin, end in (([-1, 0], [1, 0.02]), ([0.1, 0.0], [-0.6, 0.1])):
        corners = homing.around(begin, end, lamps, keep=0.25)
        way = np.array([begin, *corners, end])
        share = np.linspace(0, 1, 50)[:, None]
        legs = [a + share * (b - a) for a, b in pairwise(way)]
        legs = legs[1:] if np.hypot(*begin) < 0.25 else legs
        assert corners and min(np.hypot(*leg.T).min() for leg in legs) > 0.22
    assert homing.around([-1, 0.5], [1, 0.5], lamps, keep=0.25) == []


def test_a_robot_behind_the_lamp_gets_to_its_start_round_it():
    rig = run.rig(lights=(LAMP,), start=(0.7, 0.0, 0.0))
    world = HardwareLight(rig=rig, lights=[LAMP])
    near = []
    look = rig.eyes.poll

    def poll():
        seen = look()
        near.extend(np.hypot(*s.pose[:2]) for s in seen)
        return seen

    rig.eyes.poll = poll
    world.drive(Fixed(0.0, 0.0), cycles=1, starts=np.array([[-0.7, 0.0, 0.0]]))
    assert min(near) > 0.2
    x, y, yaw = rig.body.pose()
    assert [x, y, np.sin(yaw / 2)] == pytest.approx([-0.7, 0.0, 0.0], abs=0.02)


def test_nothing_moves_it_onto_a_lamp():
    """Where the rules do not stop it the limits do."""
    with pytest.raises(SafetyStop, match="of a lamp"):
        drive(Fixed(0.12, 0.12), (-0.6, 0.0, 0.0), supervisor={"safety": 0.0})


def test_what_cannot_be_is_refused():
    with pytest.raises(BnsError, match="sensor_dead"):
        HardwareLight(damage=["sensor_dead:sensor=left"])
    with pytest.raises(BnsError, match="one robot"):
        HardwareLight().drive(Fixed(0, 0), seeds=[0, 1])
    with pytest.raises(BnsError, match="--port"):
        HardwareLight().drive(Fixed(0, 0), seeds=[0])


def test_the_learner_drives_it(tmp_path):
    from bns import presets
    from bns.experiment.run import train

    config = presets.load("khepera-light")
    config = replace(
        config,
        trials=2,
        replicates=1,
        record_replicates=1,
        evolve_from=1,
        evolution=replace(config.evolution, population=10, generations=1, tournament=2),
        snn=replace(config.snn, epochs=2),
        light=replace(config.light, cycles=5, islands=1, circle_cycles=2),
    )
    rig = run.rig(lights=(LAMP,), start=(-0.8, 0.0, 0.0))
    record = train(config, tmp_path / "run", world=HardwareLight(rig=rig))
    assert record.trials == 2 and record["patterns"][0, -1] >= 5
    assert np.isfinite(record["fitness"]).all()


def _field():
    from bns.worlds.light.law import LightField

    return LightField((LAMP,))
