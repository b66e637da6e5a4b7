"""The stop order goes out first and in time, whatever fails around it."""

import numpy as np
import pytest

from bns.hardware.clock import VirtualClock
from bns.hardware.emulators.device import Reply, VirtualLine
from bns.hardware.emulators.khepera import KheperaBody, KheperaDevice
from bns.hardware.faults import LinkError, SafetyStop, Void
from bns.hardware.khepera.driver import Khepera3
from bns.hardware.safety.stop_order import AGAIN, insist, khepera3, phantomx

GARBAGE = np.random.default_rng(3).bytes(4000)


class Guard:
    """Remembers its food; raises an error from a moment on."""

    def __init__(self):
        self.fed, self.error = [], None

    def feed(self, *, moving):
        self.fed.append(moving)
        if self.error:
            raise self.error


class Line:
    """Notes what happens on it; each read takes a millisecond and gives the same."""

    def __init__(self, gives=b""):
        self.gives, self.events, self.now = gives, [], 0.0

    def write(self, data):
        self.events.append((self.now, data))

    def read(self, seconds):
        self.now += 0.001 if self.gives else max(seconds, 0.001)
        return self.gives


class Fickle:
    """A device whose answers are taken over from a moment on."""

    def __init__(self, device):
        self.device, self.instead = device, None

    def receive(self, data, now):
        if self.instead is None:
            return self.device.receive(data, now)
        return self.instead(data, now)

    def advance(self, now):
        self.device.advance(now)


@pytest.fixture
def driven():
    """A robot that drives, its device and its guard."""
    clock, guard = VirtualClock(), Guard()
    device = Fickle(KheperaDevice(KheperaBody()))
    robot = Khepera3(VirtualLine(device, clock), clock, guard=guard)
    robot.identify()
    robot.drive(0.1, 0.1)
    clock.sleep(1.0)
    return robot, device, guard


@pytest.mark.parametrize("gives", [b"", GARBAGE], ids=["silence", "flood"])
def test_an_order_is_written_first_and_again_until_patience_is_over(gives):
    line = Line(gives)
    done = insist(khepera3(), line.write, line.read, lambda: line.now, patience=1.0)
    assert not done
    moments = [at for at, _ in line.events]
    assert moments[0] == 0.0
    assert np.diff(moments).max() < AGAIN + 0.01 and len(moments) > 20


def test_what_counts_as_an_acknowledgement():
    wheels, servos = khepera3().answer, phantomx(5)
    assert len(wheels.findall(b"d\r\nd\n\xffd\r\n\nd\r\n")) == 3
    assert servos.command.startswith(b"\xff\xff\xfe\x04\x03\x18\x00\xe2")
    assert servos.answer.search(b"\x07\xff\xff\x05\x03\x00\x00\xf7")
    assert servos.answer.search(b"\xff\xff\x05\x03\x20\x00\xd7")  # and overloaded
    assert not servos.answer.search(b"\xff\xff\x05\x03\x00\x01\xf6")  # torque is on
    assert not servos.answer.search(b"\xff\xff\x06\x03\x00\x00\xf6")  # another one


@pytest.mark.parametrize(
    "error", [SafetyStop("its watchdog is gone"), Void("it did not answer")]
)
def test_a_dead_watchdog_keeps_no_stop_from_being_written(driven, error):
    robot, device, guard = driven
    guard.error, begin = error, robot.clock.now()
    with pytest.raises(type(error)):
        robot.drive(0.1, 0.1)
    assert not device.device.stops
    robot.stop()
    assert device.device.stops[0] - begin < 0.05
    assert max(map(abs, device.device.body.wheel_speeds())) < 0.02


def test_a_silent_line_is_given_up_in_time_and_so_is_one_that_goes_on_talking(driven):
    robot, device, _ = driven
    robot.speeds()
    device.instead, begin = lambda data, now: [], robot.clock.now()
    with pytest.raises(Void, match="said nothing"):
        robot.speeds()
    assert robot.clock.now() - begin < 0.19
    device.instead = lambda data, now: [
        Reply(now + k / 1000, GARBAGE[11 * k : 11 * k + 11]) for k in range(300)
    ]
    begin = robot.clock.now()
    with pytest.raises(Void, match="goes on talking"):
        robot.speeds()
    assert robot.clock.now() - begin < 0.05


def test_a_stop_that_is_not_confirmed_is_said_so_and_left_to_the_watchdog(driven):
    robot, device, guard = driven
    heard = []
    device.instead = lambda data, now: heard.append(data) or []
    with pytest.raises(LinkError, match="does not confirm"):
        robot.stop()
    assert heard.count(b"D,l0,l0\n") > 20
    assert guard.fed[-1] is True  # it may still move
    device.instead = None
    robot.stop()
    assert guard.fed[-1] is False


def test_wheels_that_are_told_to_stop_but_turn_are_no_success(driven):
    robot, device, guard = driven

    def turning(data, now):
        replies = device.device.receive(data, now)
        return [
            reply._replace(data=b"e,9000,9000\r\n") if data[:1] == b"E" else reply
            for reply in replies
        ]

    device.instead = turning
    with pytest.raises(LinkError, match="does not confirm"):
        robot.stop()
    assert guard.fed[-1] is True
