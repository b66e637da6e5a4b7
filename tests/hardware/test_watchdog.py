"""The watchdog stops the robot when its driver is silent, gone, or unplugged."""

import os
import signal
import threading
import time

import pytest

from bns.hardware.emulators.hexapod import ServoBank
from bns.hardware.emulators.khepera import KheperaBody, KheperaDevice
from bns.hardware.emulators.pty_host import PtyHost
from bns.hardware.faults import SafetyStop, Void
from bns.hardware.safety.watchdog_client import WatchdogClient

SLOW = 20.0  # s; a busy machine


@pytest.fixture
def robot(tmp_path):
    device = KheperaDevice(KheperaBody(at=time.monotonic()), latency=0.002)
    host = PtyHost(device, tmp_path / "port")
    done, state = threading.Event(), {"plugged": True}

    def plug(now):
        if state["plugged"]:
            host.plug()
        elif host._master >= 0:
            host.unplug()

    thread = threading.Thread(target=host.serve, args=(done.is_set, plug))
    thread.start()
    yield str(tmp_path / "port"), device, state
    done.set()
    thread.join()
    host.unplug()


def moving(port):
    fd = os.open(port, os.O_RDWR | os.O_NOCTTY)
    os.write(fd, b"D,l9000,l9000\n")
    return fd


def told_to_stand(device):
    until = time.monotonic() + SLOW
    while time.monotonic() < until:
        if device.log and device.log[-1][1:] == (0, 0):
            return True
        time.sleep(0.01)
    return False


def test_silence_stops_a_moving_robot_and_feeding_is_refused_then(robot):
    port, device, _ = robot
    fd = moving(port)
    watchdog = WatchdogClient(fd, port, 115200, "khepera3", silence=0.2)
    watchdog.feed(moving=True)
    assert told_to_stand(device)
    time.sleep(0.3)
    with pytest.raises(Void, match="watchdog stopped"):
        watchdog.feed(moving=True)
    watchdog.feed(moving=False)
    watchdog.release()
    os.close(fd)


def test_the_end_of_the_driver_stops_it(robot):
    port, device, _ = robot
    fd = moving(port)
    watchdog = WatchdogClient(fd, port, 115200, "khepera3")
    watchdog.feed(moving=False)
    os.close(watchdog._writer)  # as when the driving process is killed
    assert told_to_stand(device)
    assert watchdog._process.wait(SLOW) == 0
    os.close(fd)


def test_a_cable_that_comes_back_is_used_to_stop(robot):
    port, device, state = robot
    fd = moving(port)
    watchdog = WatchdogClient(fd, port, 115200, "khepera3")
    state["plugged"] = False
    while os.path.exists(port):
        time.sleep(0.01)
    os.close(watchdog._writer)
    time.sleep(0.3)
    assert device.log[-1][1:] == (9000, 9000)
    state["plugged"] = True
    assert told_to_stand(device)
    watchdog._process.wait(SLOW)
    os.close(fd)


def test_a_watchdog_that_is_killed_is_missed_at_once(robot):
    port, _, _ = robot
    fd = moving(port)
    watchdog = WatchdogClient(fd, port, 115200, "khepera3")
    watchdog.feed(moving=True)
    os.kill(watchdog.pid, signal.SIGKILL)
    watchdog._process.wait(SLOW)
    with pytest.raises(SafetyStop, match="watchdog is gone"):
        watchdog.feed(moving=True)
    watchdog.release()
    os.close(fd)


def test_a_watchdog_that_hangs_is_noticed_and_nothing_moves_with_it(robot):
    port, _, _ = robot
    fd = moving(port)
    watchdog = WatchdogClient(fd, port, 115200, "khepera3", silence=SLOW)
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
    os.close(fd)


def test_a_line_that_goes_on_talking_holds_up_no_stop(tmp_path):
    device = KheperaDevice(KheperaBody(at=time.monotonic()), latency=0.002)
    host, done = PtyHost(device, tmp_path / "port", baud=115200), threading.Event()
    thread = threading.Thread(target=host.serve, args=(done.is_set,))
    thread.start()
    port = str(tmp_path / "port")
    try:
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
    finally:
        done.set()
        thread.join()
        host.unplug()


def test_a_robot_whose_stop_was_not_confirmed_is_stopped_after_the_session(robot):
    port, device, _ = robot
    fd = moving(port)
    watchdog = WatchdogClient(fd, port, 115200, "khepera3", silence=SLOW)
    watchdog.feed(moving=True)
    watchdog.release()
    assert told_to_stand(device)
    assert watchdog._process.wait(SLOW) == 0
    os.close(fd)


def test_servos_without_torque_acknowledge_the_stop(tmp_path):
    bank = ServoBank(at=time.monotonic())
    for table in bank.tables.values():
        table[24] = 1
    host, done = PtyHost(bank, tmp_path / "bus"), threading.Event()
    thread = threading.Thread(target=host.serve, args=(done.is_set,))
    thread.start()
    port = str(tmp_path / "bus")
    try:
        fd = os.open(port, os.O_RDWR | os.O_NOCTTY)
        watchdog = WatchdogClient(fd, port, 1000000, "phantomx", servo=5)
        watchdog.feed(moving=True)
        watchdog.release()
        assert watchdog._process.wait(SLOW) == 0  # 1 where nothing acknowledges
        assert not any(table[24] for table in bank.tables.values())
        os.close(fd)
    finally:
        done.set()
        thread.join()
        host.unplug()
