"""Another program on the port: it is seen, named, and nothing is driven beside it."""

import contextlib
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import tty
from types import SimpleNamespace

import pytest

from bns.errors import BnsError
from bns.hardware.clock import VirtualClock
from bns.hardware.line import Openers
from bns.hardware.safety import watchdog
from bns.hardware.worlds import real_robot

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the kernel tells")
SLOW = 20.0  # s; a busy machine
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


def test_no_trial_begins_while_another_program_has_the_port():
    rig = Rig(5)
    real_robot._alone(rig)
    assert rig.checks == 5 and rig.clock.now() == pytest.approx(0.5)
    with pytest.raises(BnsError, match=r"picocom \(17\): end it"):
        real_robot._alone(Rig(1000))


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
