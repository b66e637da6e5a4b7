"""The hexapod as a hardware world, over emulated servos with a body behind them.

It gets up from rest, and from nothing else.
"""

import threading

import numpy as np
import pytest

from bns.errors import BnsError
from bns.hardware.clock import RealClock, VirtualClock
from bns.hardware.driving import excitation
from bns.hardware.dynamixel import joints, packets, rig
from bns.hardware.dynamixel.walker import LIES, SPEED, STILL, Walked, Walker
from bns.hardware.emulators.hexapod import HexapodBody, ServoBank
from bns.hardware.emulators.pty_host import PtyHost
from bns.hardware.emulators.run import phantomx
from bns.hardware.faults import FaultLog, Void
from bns.hardware.safety.limits import Limits, Operator
from bns.hardware.tracking.tracker import Sighting
from bns.hardware.worlds import hexapod, records
from bns.hardware.worlds.hexapod import HardwareHexapod
from bns.models import robot
from bns.models.legs import JOINTS
from bns.models.phantomx import servos
from bns.worlds.active import Stages
from bns.worlds.damage import Damage
from bns.worlds.trial import POSE_CHANNELS, Channel, Commands

pytest.importorskip("dynamixel_sdk")
pytest.importorskip("serial")

CHANNELS = tuple(Channel(*channel) for channel in robot("phantomx").channels)


def goals(*rows, limit=2.0):
    values = np.zeros((len(rows), 18))
    for row, changes in zip(values, rows, strict=True):
        for name, angle in changes.items():
            row[JOINTS.index(name)] = angle
    return Commands(values, np.full(len(rows), limit), CHANNELS)


def test_the_drivers_joints_are_those_of_the_model():
    table = joints.read()
    assert {joint.name: joint.id for joint in table} == dict(servos.IDS)
    signs = dict(zip(JOINTS, servos.SIGNS, strict=True))
    low, high = robot("phantomx").ranges.T
    for joint in table:
        at = JOINTS.index(joint.name)
        assert joint.sign == signs[joint.name]
        ends = sorted((joint.angle(joint.low), joint.angle(joint.high)))
        np.testing.assert_allclose(ends, [low[at], high[at]], atol=0.006)


def test_a_body_hangs_on_its_stand_until_it_is_powered_and_then_obeys():
    body = HexapodBody()
    femur = {joint.name: joint for joint in joints.read()}["left_front_femur"]
    body.advance(1.0)
    assert body.stand and body.reading(femur.id).units == 512
    for number in body.joints:
        body.tell(number, 512)
        body.power(number, True)
    body.tell(femur.id, femur.units(0.3))
    body.advance(2.5)
    assert body.reading(femur.id).units == pytest.approx(femur.units(0.3), abs=4)
    assert body.attitude()[0] > 0.07  # it stands
    for number in body.joints:
        body.power(number, False)
    body.advance(4.5)
    assert body.attitude()[0] < 0.06  # it lies


def test_software_damage_changes_what_is_sent_before_the_first_command_as_well():
    given = goals({"left_front_femur": -0.2, "right_rear_coxa": 0.1}, {})
    damage = Damage.parse(["leg_raised:legs=1,blend=1"])
    stages = Stages.of(Damage.none(), damage, 0, given.duration)
    sent, before = hexapod.told(given, stages, 0, 0)
    femur = JOINTS.index("left_front_femur")
    assert sent[:, femur] == pytest.approx([1.3, 1.3]) and before[femur] == 1.3
    assert sent[0, JOINTS.index("right_rear_coxa")] == 0.1
    with pytest.raises(BnsError, match="servo_gain"):
        HardwareHexapod(damage=["servo_gain:joint=all,factor=0.5"])


def carried_out(count, late=0.001):
    done = Walked(late=late, left=True)
    done.switched = [float(k) for k in range(count + 1)]
    done.sightings = [
        Sighting(t, np.array([0.1 * t, 0.0, 0.0]), 0.1)
        for t in np.arange(-0.2, count + 0.3, 0.1)
    ]
    done.readings = {"left_front_coxa": [(0.0, 0.0), (float(count), 0.5)]}
    return done


def made(done, given):
    channels = (*POSE_CHANNELS, Channel("left_front_coxa_position", "rad"))
    return records.walked_trial(
        done,
        given,
        sample_dt=0.1,
        start_yaw=0.0,
        robot="phantomx",
        world="hardware",
        channels=channels,
        conditions={},
    )


def test_a_walk_that_was_ended_early_has_no_poses_where_it_did_not_come_to():
    trial = made(carried_out(2), goals({}, {}, {}, {}))
    poses = trial.command_poses_world
    np.testing.assert_allclose(poses[:3, 0], [0.0, 0.1, 0.2], atol=1e-6)
    assert np.isnan(poses[3:]).all() and trial.outcome.left_arena
    assert trial.handled.tolist() == [False, False, True, True]
    assert trial.channel("left_front_coxa_position")[0] == 0.0
    with pytest.raises(Void, match="late"):
        made(carried_out(2, late=0.4), goals({}, {}))


def test_zeros_are_where_the_servos_stand_and_end_stops_move_along(tmp_path, serving):
    bank = ServoBank(at=RealClock().now())
    bank.place[5] = 525.0
    with serving(PtyHost(bank, tmp_path / "bus")):
        list(rig.calibrate(str(tmp_path / "bus"), "", tmp_path / "own.toml"))
        bank.place[5] = 640.0
        with pytest.raises(BnsError, match="left_front_tibia reads 640"):
            list(rig.calibrate(str(tmp_path / "bus"), "", tmp_path / "b.toml"))
    before = {joint.id: joint for joint in joints.read()}
    after = {joint.id: joint for joint in joints.read(tmp_path / "own.toml")}
    assert after[5] == before[5]._replace(zero=525, low=292, high=870)
    assert after[4] == before[4]


def test_where_it_rests_the_last_reading_and_picture_hold():
    """The next ones already show it moving."""
    done = carried_out(2)
    moving = [(0.95, 0.1), (1.05, 0.3), (1.95, 0.4)]
    done.readings = {"left_front_coxa": [(0.0, 0.1), *moving, (2.05, 0.4)]}
    done.sightings = [s for s in done.sightings if abs(s.time - 1.0) > 0.01]
    trial = made(done, goals({}, {}))
    read = trial.channel("left_front_coxa_position")
    assert read[trial.boundaries] == pytest.approx([0.1, 0.1, 0.4])
    assert trial.command_poses_world[1, 0] == pytest.approx(0.09)
    assert read[11] == pytest.approx(0.3 + 0.1 * 0.05 / 0.9)  # at 1.1 s, between two


def test_recorded_gaits_differ_and_take_turns_in_direction():
    from bns.worlds import registry

    ahead, back = (excitation.steps(6, seed=1, number=number) for number in (0, 1))
    world = registry.make("hexapod", threads=1)
    ends = [trial.poses_world[-1, 0] for trial in world.run([ahead, back])]
    assert ends[0] > 0.1 and ends[1] < -0.1
    again = excitation.steps(6, seed=1, number=0)
    assert np.array_equal(ahead.values, again.values)
    other = excitation.steps(6, seed=2, number=0)
    assert not np.array_equal(ahead.values, other.values)


def test_a_trial_in_real_time(tmp_path):
    done = threading.Event()
    words = {"stop": done.is_set, "log": str(tmp_path / "log")}
    thread = threading.Thread(target=phantomx, args=(tmp_path / "bus",), kwargs=words)
    thread.start()
    world = HardwareHexapod(port=str(tmp_path / "bus"), sample_dt=60.0)
    try:
        while not (tmp_path / "bus").exists():
            done.wait(0.02)
        given = goals({"left_middle_femur": 0.5}, {"right_front_coxa": 0.2})
        (trial,) = world.run([given], trial=3)
    finally:
        world.close()
        done.wait(0.3)
        done.set()
        thread.join()
    read = trial.channel("left_middle_femur_position")[trial.boundaries]
    assert read == pytest.approx([0.0, 0.5, 0.0], abs=0.08)
    assert len(trial.times) == 3  # where it rests, as recordings are
    assert (trial.commands.durations > 0.5 / SPEED).all()
    assert np.isfinite(trial.poses_world).all() and trial.conditions["frames"] > 20
    assert np.hypot(*trial.poses_world[-1, :2]) < 0.06
    lines = (tmp_path / "log").read_text().splitlines()
    assert '"powered": 0' in [line for line in lines if "powered" in line][-1]


class Servos:
    """A bus whose servos sink until a moment; notes when torque goes on."""

    def __init__(self, clock, sinks):
        self.clock, self.sinks, self.guard = clock, sinks, None
        self.joints, self.on, self.goals = joints.read(), [], None

    def read(self, servo):
        self.clock.sleep(0.0015)
        moved = round(100 * min(self.clock.now(), self.sinks))
        return packets.State(512 + moved, 0, 0.0, 11.1, 35)

    def look(self, count):
        return [(joint, self.read(joint.id)) for joint in self.joints[:count]]

    def write(self, goals):
        self.goals = self.goals or goals

    def power(self):
        self.on.append(self.clock.now())

    def powered(self):
        pass

    def pace(self, speed):
        pass

    def stop(self):
        pass


class Eyes:
    """See the robot where it is, at every look."""

    def __init__(self, clock, tag=lambda now: 0.0):
        self.clock, self.tag = clock, tag

    def poll(self):
        now = self.clock.now()
        return [Sighting(now, np.array([self.tag(now), 0.0, 0.0]), 0.1)]


def walker(sinks, **words):
    clock = VirtualClock()
    bus, names = Servos(clock, sinks), tuple(joint.name for joint in joints.read())
    rest = {"limits": Limits(), "operator": Operator(), "faults": FaultLog(clock)}
    return Walker(bus, Eyes(clock, **words), clock, names=names, **rest), bus


def test_torque_comes_on_once_the_robot_that_was_stopped_has_come_to_rest():
    made, bus = walker(sinks=0.8)
    made.rise()
    assert 0.8 + STILL <= bus.on[0] < 0.8 + STILL + 0.2
    joint = bus.joints[0]
    assert bus.goals[joint.name] == joint.angle(592)  # it begins where it lies
    made, bus = walker(sinks=0.0, tag=lambda now: 0.1 * min(now, 1.5))
    made.rise()
    assert 1.5 + STILL - 0.02 <= bus.on[0] < 1.5 + STILL + 0.2


def test_a_robot_that_is_carried_is_not_switched_on():
    made, bus = walker(sinks=1e9)
    with pytest.raises(BnsError, match="let go of it"):
        made.rise()
    assert not bus.on and made.clock.now() > LIES
