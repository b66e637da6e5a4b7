"""Drivers against emulated robots.

The Khepera III's in virtual time; ROBOTIS's SDK, on the hexapod's bus, against servos
on a pseudo terminal.
"""

import os
import time
from contextlib import ExitStack

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.hardware.clock import RealClock, VirtualClock
from bns.hardware.dynamixel import joints, packets
from bns.hardware.emulators.device import Noise, Reply, VirtualLine
from bns.hardware.emulators.hexapod import ServoBank
from bns.hardware.emulators.khepera import KheperaBody, KheperaDevice
from bns.hardware.emulators.pty_host import PtyHost
from bns.hardware.faults import LinkError, SafetyStop, Void
from bns.hardware.khepera import protocol
from bns.hardware.khepera.driver import Khepera3


class Talker:
    """A device that says the same whatever it is asked."""

    def __init__(self, data):
        self.data = data

    def receive(self, data, now):
        return [Reply(now + 0.001, self.data)] if self.data else []

    def advance(self, now):
        pass


def connected(device, clock, **settings):
    return Khepera3(VirtualLine(device, clock), clock, **settings)


@pytest.fixture
def clock():
    return VirtualClock()


@pytest.mark.parametrize("version,units", [((2, 5), 17281), ((3, 1), 26246)])
def test_both_generations_of_firmware_drive_at_the_speed_told(
    clock, version, units, guard
):
    device = KheperaDevice(KheperaBody(), version=version)
    robot = connected(device, clock, guard=guard)
    assert robot.identify() == version
    robot.drive(0.12, 0.12)
    assert device.log[-1][1:] == (units, units)
    clock.sleep(3.0)
    before = robot.positions()
    start = clock.now()
    clock.sleep(1.0)
    way = robot.units.distance(robot.positions()[0] - before[0])
    assert way / (clock.now() - start) == pytest.approx(0.12, rel=0.02)
    robot.stop()
    assert max(map(abs, robot.speeds())) < 1500


def test_line_endings_and_the_binary_frame(clock):
    for ending in (b"\n", b"\r\n", b"\n\r"):
        robot = connected(KheperaDevice(KheperaBody(), ending=ending), clock)
        assert robot.identify() == (2, 5)
        assert robot.battery() == 7.9
        assert len(robot.proximity()) == len(robot.ambient()) == 11
    reading = robot.everything()
    assert reading.proximity == robot.proximity()
    assert protocol.FRAME.size == 67
    assert len(robot.faults) == 0


def test_the_emulator_has_the_quirks_of_the_server(clock):
    device = KheperaDevice(KheperaBody())
    assert device.receive(b"D,20000,-20000\n", 0.0)[0].data == b"d\r\n"
    assert device.log[-1][1:] == (0, 20000)  # first characters blanked
    device.receive(b"D,l700,l800\n", 1.0)
    device.receive(b"D\n", 2.0)
    assert device.log[-1][1:] == (700, 800)  # stale arguments
    assert device.receive(b"Y\n", 3.0)[0].data == b"$\r\n"
    assert device.receive(b"V\n", 4.0)[0].data == b"$\r\n"
    answers = device.receive(b"B\nE\n", 5.0)
    assert [reply.data for reply in answers] == [b"b,2,5\r\n"]  # no pipelining
    assert device.receive(b"\r\n\r\n", 6.0) == []


def test_nothing_moves_unguarded_unidentified_or_too_fast(clock, guard):
    device = KheperaDevice(KheperaBody())
    robot = connected(device, clock)
    with pytest.raises(BnsError, match="firmware is not known"):
        robot.drive(0.1, 0.1)
    robot.identify()
    with pytest.raises(BnsError, match="Nobody guards"):
        robot.drive(0.1, 0.1)
    robot.guard = guard
    with pytest.raises(BnsError, match=r"above the limit of 0\.15 m/s"):
        robot.drive(0.2, 0.0)
    assert not device.log
    robot.drive(0.1, 0.0)
    assert set(guard.fed) == {True}


STRANGERS = {
    "silence": (b"", "Nothing answers"),
    "hexapod": (b"\xff\xff\x01\x02\x00\xfc", "hexapod, no Khepera"),
    "wrong baud": (b"\xf8\x80\x00\xe6", "baud rate is wrong"),
    "another robot": (b"ok marlin 1.1\r\n", "is no Khepera III"),
    "unknown firmware": (b"b,77,0\r\n", r"Firmware 77\.0 is not known"),
}


@pytest.mark.parametrize("name", STRANGERS)
def test_a_stranger_on_the_port_is_named(clock, name):
    says, match = STRANGERS[name]
    with pytest.raises(BnsError, match=match):
        connected(Talker(says), clock).identify()


def test_a_bad_line_is_survived_and_every_fault_is_noted(clock, guard):
    device = KheperaDevice(KheperaBody())
    noise = Noise(device, lost=0.01, corrupted=0.01, rng=np.random.default_rng(1))
    robot = connected(noise, clock, guard=guard)
    robot.identify()
    for _ in range(100):
        robot.drive(0.1, 0.1, times=2)
    robot.stop()
    assert len(robot.faults) >= 10
    assert set(robot.faults.counts) <= {"no answer", "garbled answer", "cut answer"}
    assert max(map(abs, device.body.wheel_speeds())) < 0.02


def test_a_dead_line_is_said_so(clock):
    line = VirtualLine(KheperaDevice(KheperaBody()), clock)
    robot = Khepera3(line, clock)
    robot.identify()
    line.plugged = False
    with pytest.raises(LinkError, match="unplugged"):
        robot.speeds()


@pytest.mark.parametrize(
    "line,letter,numbers",
    [
        (b"e,12,-7", "e", (12, -7)),
        (b"d", "d", ()),
        (b"e,12", "e", None),
        (b"e,12,", "e", None),
        (b"e,1x,2", "e", None),
        (b"f,1,2", "e", None),
        (b"e,\xff,2", "e", None),
        (b"n,1,2,3,4,5,6,7,8,9,10,11,99", "o", (*range(1, 12), 99)),
    ],
)
def test_answers_are_checked_to_the_letter(line, letter, numbers):
    assert protocol.numbers(line, letter) == numbers


@pytest.fixture
def served(tmp_path, serving):
    """Serves servos on a port; gives port and servos."""
    pytest.importorskip("dynamixel_sdk")
    pytest.importorskip("serial")
    with ExitStack() as ends:

        def serve(**settings):
            bank = ServoBank(at=RealClock().now(), **settings)
            bank.host = PtyHost(bank, tmp_path / "bus")
            ends.enter_context(serving(bank.host))
            return str(tmp_path / "bus"), bank

        yield serve


def opened(port, **settings):
    from bns.hardware.dynamixel.bus import Bus

    return Bus(port, joints.read(), RealClock(), latency=0.3, **settings)


def test_goals_reach_all_servos_and_states_come_back(served, guard):
    port, bank = served()
    bus = opened(port, guard=guard)
    bus.identify()
    bus.power()
    bus.write({joint.name: 0.2 for joint in bus.joints})
    RealClock().sleep(0.5)
    for joint in bus.joints:
        state = bus.read(joint.id)
        assert joint.angle(state.position) == pytest.approx(0.2, abs=0.01)
        assert (state.voltage, state.temperature) == (11.1, 35)
    assert bus.guard.fed[-1] is True
    bus.close()
    RealClock().sleep(0.05)
    assert not any(table[packets.TORQUE] for table in bank.tables.values())


def test_missing_and_doubled_servos_are_named(served):
    port, _ = served(numbers=[n for n in range(1, 19) if n != 7])
    with pytest.raises(BnsError, match=r"Servos \[7\] do not answer"):
        opened(port).identify()


def test_doubled_servos_are_named(served):
    port, _ = served(numbers=[*range(1, 19), 5])
    with pytest.raises(BnsError, match=r"\[5\].*two have one number"):
        opened(port).identify()


def test_nothing_moves_unguarded_and_a_low_battery_stops(served):
    port, bank = served(voltage=9.5)
    bus = opened(port)
    with pytest.raises(BnsError, match="Nobody guards"):
        bus.write({joint.name: 0.0 for joint in bus.joints})
    assert not bank.goals
    with pytest.raises(SafetyStop, match=r"9\.5 V"):
        bus.look()


def test_goals_stay_between_the_end_stops():
    joint = joints.Joint("knee", 1, -1, 512, 200, 800)
    assert joint.units(0.0) == 512
    assert joint.units(9.0) == 200
    assert joint.angle(joint.units(0.5)) == pytest.approx(0.5, abs=0.003)


def test_a_servo_given_twice_is_refused(tmp_path):
    path = tmp_path / "r.toml"
    line = "{ id = 1, sign = 1, zero = 512, low = 1, high = 9 }"
    path.write_text(f"[joints]\na = {line}\nb = {line}\n")
    with pytest.raises(FormatError, match="servo 1 is given twice"):
        joints.read(path)


def test_packets_of_the_manual():
    found, rest = packets.instructions(b"\xff\xff\x01\x02\x01\xfb")
    assert found == [packets.Instruction(1, packets.PING, b"")] and rest == b""
    assert packets.status(1, 0) == b"\xff\xff\x01\x02\x00\xfc"
    assert packets.words(0b100001) == "input voltage, overload"
    spoilt = packets.instructions(b"\xff\xff\x01\x02\x01\xfa\xff\xff\x01\x02\x01\xfb")
    assert len(spoilt[0]) == 1


def test_a_full_turn_of_the_law_takes_the_motors_time():
    bank = ServoBank([1])
    bank.tables[1][packets.TORQUE] = 1
    bank.tables[1][30:32] = b"\xff\x03"
    for step in range(1, 101):
        bank.advance(step * 0.01)
    way = bank.place[1] - 512
    assert 0.9 * 511 < way <= 511
    assert np.isclose(packets.UNITS, 1023 / np.deg2rad(300), rtol=1e-5)


@pytest.fixture
def standing(served, guard):
    """A bus whose servos hold, and the servos."""
    port, bank = served()
    bus = opened(port, guard=guard)
    bus.write({joint.name: 0.0 for joint in bus.joints})
    bus.power()
    bus.read(1)
    return bus, bank


def test_a_bus_that_goes_on_talking_is_left_and_the_stop_gets_through(standing):
    bus, bank = standing
    bank.host.baud, bank.host.flooded = packets.BAUD, True
    with pytest.raises((Void, LinkError)):
        for _ in range(200):
            bus.read(2)
    bank.host.flooded = False
    bus.stop()
    assert not any(table[packets.TORQUE] for table in bank.tables.values())
    assert bus.guard.fed[-1] is False
    bus.release()


def test_servos_that_were_reset_are_noticed(standing):
    bus, bank = standing
    bus.powered()
    bank.restart(RealClock().now(), power=True)
    with pytest.raises(Void, match="has lost its torque"):
        bus.powered()
    bus.close()


def test_a_stop_that_no_servo_confirms_is_said_so(standing):
    bus, bank = standing
    bank.host.deaf_until = float("inf")
    with pytest.raises(LinkError, match="do not confirm"):
        bus.stop()
    assert bus.guard.fed[-1] is True
    bus.release()


def test_somebody_who_opens_the_port_stops_the_robot(standing):
    bus, bank = standing
    other = os.open(bank.host.link, os.O_RDWR | os.O_NOCTTY)
    os.close(other)
    with pytest.raises(Void, match="another program"):
        bus.write({joint.name: 0.0 for joint in bus.joints})
    bus.close()


def test_a_wall_clock_that_is_set_does_not_matter(standing, monkeypatch):
    bus, _ = standing
    jumps = iter(range(10**6))
    real = time.time
    monkeypatch.setattr(time, "time", lambda: real() + 3600 * (next(jumps) % 3 - 1))
    for joint in bus.joints:
        assert bus.read(joint.id).voltage == 11.1
    assert not len(bus.faults)
    bus.close()


def test_a_servo_that_falls_silent_makes_the_trial_void_where_torque_is_on(standing):
    bus, bank = standing
    bank.numbers.remove(7)
    with pytest.raises(Void, match="servo 7 gave no proper answer"):
        bus.read(7)
    bus.stop()
    with pytest.raises(LinkError, match="check its cable"):
        bus.read(7)
    bus.close()


def test_an_answer_is_not_waited_for_without_end_on_a_line_that_never_rests(standing):
    bus, _ = standing
    bus.stop()
    begin = time.monotonic()
    with open("/dev/zero", "rb", buffering=0) as garbage:
        line, bus._port.ser = bus._port.ser, garbage
        bus._port.setPacketTimeout(8)
        _, result = bus._protocol.rxPacket(bus._port)
        bus._port.ser = line
    assert result != 0 and time.monotonic() - begin < 10.0
    bus.close()
