"""The Khepera III's driver against the emulated robot, in virtual time."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.hardware.clock import VirtualClock
from bns.hardware.emulators.device import Noise, Reply, VirtualLine
from bns.hardware.emulators.khepera import KheperaBody, KheperaDevice
from bns.hardware.faults import LinkError
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
