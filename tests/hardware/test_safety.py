"""The robot is stopped, whatever fails.

The stop order goes out first and in time; the watchdog gives it when the robot's driver
is silent, gone, or unplugged. Another program on the port is seen and named, and
nothing is driven beside it.
"""

import contextlib
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time
import tty
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from bns.errors import BnsError
from bns.hardware.clock import VirtualClock
from bns.hardware.emulators.device import Reply, VirtualLine
from bns.hardware.emulators.hexapod import ServoBank
from bns.hardware.emulators.khepera import KheperaBody, KheperaDevice
from bns.hardware.emulators.pty_host import PtyHost
from bns.hardware.faults import LinkError, SafetyStop, Void
from bns.hardware.khepera.driver import Khepera3
from bns.hardware.line import Openers
from bns.hardware.safety import watchdog
from bns.hardware.safety.stop_order import AGAIN, insist, khepera3, phantomx
from bns.hardware.safety.watchdog_client import WatchdogClient
from bns.hardware.worlds import real_robot

GARBAGE = np.random.default_rng(3).bytes(4000)


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
def driven(guard):
    """A robot that drives, its device and its guard."""
    clock = VirtualClock()
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


SLOW = 20.0  # s; a busy machine


@pytest.fixture
def robot(tmp_path, serving):
    device = KheperaDevice(KheperaBody(at=time.monotonic()), latency=0.002)
    host = PtyHost(device, tmp_path / "port")
    state = {"plugged": True}

    def plug(now):
        if state["plugged"]:
            host.plug()
        elif host._master >= 0:
            host.unplug()

    with serving(host, plug):
        yield str(tmp_path / "port"), device, state


def moving(port):
    fd = os.open(port, os.O_RDWR | os.O_NOCTTY)
    os.write(fd, b"D,l9000,l9000\n")
    return fd


@pytest.fixture
def told_to_stand(waited):
    """Waits until a device is told to stand; whether it was."""
    return lambda device: waited(lambda: device.log and device.log[-1][1:] == (0, 0))


@pytest.fixture
def guarded(robot):
    """Starts the watchdog of a robot that moves."""
    port, *_ = robot
    fd = moving(port)
    yield partial(WatchdogClient, fd, port, 115200, "khepera3")
    os.close(fd)


def test_silence_stops_a_moving_robot_and_feeding_is_refused_then(
    robot, guarded, told_to_stand
):
    _, device, _ = robot
    watchdog = guarded(silence=0.2)
    watchdog.feed(moving=True)
    assert told_to_stand(device)
    time.sleep(0.3)
    with pytest.raises(Void, match="watchdog stopped"):
        watchdog.feed(moving=True)
    watchdog.feed(moving=False)
    watchdog.release()


def test_the_end_of_the_driver_stops_it(robot, guarded, told_to_stand):
    _, device, _ = robot
    watchdog = guarded()
    watchdog.feed(moving=False)
    os.close(watchdog._writer)  # as when the driving process is killed
    assert told_to_stand(device)
    assert watchdog._process.wait(SLOW) == 0


def test_a_cable_that_comes_back_is_used_to_stop(robot, guarded, told_to_stand):
    port, device, state = robot
    watchdog = guarded()
    state["plugged"] = False
    while os.path.exists(port):
        time.sleep(0.01)
    os.close(watchdog._writer)
    time.sleep(0.3)
    assert device.log[-1][1:] == (9000, 9000)
    state["plugged"] = True
    assert told_to_stand(device)
    watchdog._process.wait(SLOW)


def test_a_watchdog_that_is_killed_is_missed_at_once(guarded):
    watchdog = guarded()
    watchdog.feed(moving=True)
    os.kill(watchdog.pid, signal.SIGKILL)
    watchdog._process.wait(SLOW)
    with pytest.raises(SafetyStop, match="watchdog is gone"):
        watchdog.feed(moving=True)
    watchdog.release()


def test_a_watchdog_that_hangs_is_noticed_and_nothing_moves_with_it(guarded):
    watchdog = guarded(silence=SLOW)
    watchdog.feed(moving=True)
    os.kill(watchdog.pid, signal.SIGSTOP)
    begin = time.monotonic()
    with pytest.raises(Void, match="did not answer"):
        while time.monotonic() < begin + SLOW:
            watchdog.feed(moving=True)
            time.sleep(0.02)
    with pytest.raises(Void):
        watchdog.feed(moving=False)  # as `stop` does, which does not mind
    with pytest.raises(SafetyStop, match="does not answer"):
        watchdog.feed(moving=True)
    os.kill(watchdog.pid, signal.SIGKILL)
    watchdog.release()
    assert watchdog._process.poll() is not None


def test_a_line_that_goes_on_talking_holds_up_no_stop(tmp_path, serving, told_to_stand):
    device = KheperaDevice(KheperaBody(at=time.monotonic()), latency=0.002)
    host, port = PtyHost(device, tmp_path / "port", baud=115200), str(tmp_path / "port")
    with serving(host):
        fd = moving(port)
        words = {"silence": 0.2, "patience": 3.0}
        watchdog = WatchdogClient(fd, port, 115200, "khepera3", **words)
        watchdog.feed(moving=True)
        host.flooded = True
        assert told_to_stand(device)
        host.flooded = False
        watchdog.release()
        watchdog._process.wait(SLOW)
        os.close(fd)


def test_a_stop_that_was_not_confirmed_is_made_after_the_session(
    robot, guarded, told_to_stand
):
    _, device, _ = robot
    watchdog = guarded(silence=SLOW)
    watchdog.feed(moving=True)
    watchdog.release()
    assert told_to_stand(device)
    assert watchdog._process.wait(SLOW) == 0


def test_servos_without_torque_acknowledge_the_stop(tmp_path, serving):
    bank = ServoBank(at=time.monotonic())
    for table in bank.tables.values():
        table[24] = 1
    host, port = PtyHost(bank, tmp_path / "bus"), str(tmp_path / "bus")
    with serving(host):
        fd = os.open(port, os.O_RDWR | os.O_NOCTTY)
        watchdog = WatchdogClient(fd, port, 1000000, "phantomx", servo=5)
        watchdog.feed(moving=True)
        watchdog.release()
        assert watchdog._process.wait(SLOW) == 0  # 1 where nothing acknowledges
        assert not any(table[24] for table in bank.tables.values())
        os.close(fd)


ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="the kernel tells")
HOLD = 'sleep 60 9<>"$0" >/dev/null 2>&1 & echo $!'


@pytest.fixture
def port():
    """Both ends of a pseudo terminal; the second is the robot's port."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(slave, False)
    yield master, slave
    for number in (master, slave):
        with contextlib.suppress(OSError):
            os.close(number)


@ON_LINUX
def test_who_holds_the_port_is_named_until_it_lets_go(port, waited):
    name = os.ttyname(port[1])
    openers = Openers(name)
    assert not openers.intruder() and openers.others() == []
    made = subprocess.run(["sh", "-c", HOLD, name], capture_output=True, text=True)
    try:
        assert waited(openers.intruder)
        assert (
            openers.others() == openers.others() == [f"sleep ({made.stdout.strip()})"]
        )
    finally:
        os.kill(int(made.stdout), signal.SIGKILL)
    assert waited(lambda: openers.others() == [])
    openers.close()


@ON_LINUX
def test_a_child_that_shares_the_port_is_no_other_program(port):
    name = os.ttyname(port[1])
    openers = Openers(name)
    os.close(os.open(name, os.O_RDWR | os.O_NOCTTY))
    words = {"stdin": subprocess.PIPE, "pass_fds": (port[1],)}
    child = subprocess.Popen([sys.executable, "-S", "-c", "input()"], **words)
    assert openers.others() == []
    child.communicate(b"\n")
    openers.close()


class Rig:
    """Somebody else has its port open for some looks."""

    def __init__(self, looks):
        self.clock, self.looks, self.checks = VirtualClock(), looks, 0
        self.operator = SimpleNamespace(check=self._check)

    def _check(self):
        self.checks += 1

    def others(self):
        self.looks -= 1
        return ["picocom (17)"] if self.looks >= 0 else []


@ON_LINUX
def test_no_trial_begins_while_another_program_has_the_port():
    rig = Rig(5)
    real_robot._alone(rig)
    assert rig.checks == 5 and rig.clock.now() == pytest.approx(0.5)
    with pytest.raises(BnsError, match=r"picocom \(17\): end it"):
        real_robot._alone(Rig(1000))


@ON_LINUX
def test_bytes_that_another_program_took_are_no_dead_line(port, monkeypatch):
    master, slave = port
    os.write(master, b"answer")
    assert watchdog.receive(slave, SLOW) == b"answer"
    assert watchdog.receive(slave, 0.0) == b""
    ready = SimpleNamespace(select=lambda *words: words[:3], poll=select.poll)
    for name in ("POLLIN", "POLLHUP", "POLLERR", "POLLNVAL"):
        setattr(ready, name, getattr(select, name))
    monkeypatch.setattr(watchdog, "select", ready)  # there was a byte; it is gone
    settings = termios.tcgetattr(slave)
    settings[6][termios.VMIN] = 0  # as pyserial sets it: a read gives nothing at once
    termios.tcsetattr(slave, termios.TCSANOW, settings)
    assert watchdog.receive(slave, SLOW) == b""
    os.close(master)
    with pytest.raises(OSError, match=r"line is dead|Input/output"):
        watchdog.receive(slave, SLOW)
