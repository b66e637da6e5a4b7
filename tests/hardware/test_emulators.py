"""Emulated robots: looked at at any moment; mishaps that they are told to have."""

import os
import threading
import time

import numpy as np
import pytest

from bns.hardware.emulators.camera import EmulatedCamera, painter
from bns.hardware.emulators.khepera import KheperaBody
from bns.hardware.emulators.pty_host import WORDS
from bns.hardware.emulators.run import khepera3
from bns.hardware.tracking.camera import Camera

pytest.importorskip("cv2")

SPEED = 0.1  # m/s


def test_a_picture_shows_the_moment_and_not_the_nearest_physics_step():
    body = KheperaBody()
    body.tell(0.0, -SPEED, SPEED)
    body.advance(1.5)
    moments = 1.0 + np.arange(40) * body.dt / 8
    yaws = np.array([body.pose(at)[2] for at in moments])
    rate = np.diff(yaws) / np.diff(moments)
    assert rate == pytest.approx(np.full(39, rate.mean()), rel=0.05)
    assert rate.mean() > 1.5  # it turns


def test_a_moment_ahead_of_the_physics_is_reached_by_going_straight_on():
    body = KheperaBody()
    body.tell(0.0, SPEED, SPEED)
    body.advance(1.0 + 1e-6)
    ahead = 1.0 + 0.6 * body.dt
    seen = body.pose(ahead)
    body.advance(1.5)
    assert seen[0] == pytest.approx(body.pose(ahead)[0], abs=1e-6)
    assert body.pose(0.0)[0] == pytest.approx(0.0, abs=1e-4)


def test_the_attitude_stays_a_rotation_between_steps():
    body = KheperaBody()
    body.tell(0.0, -SPEED, SPEED)
    body.advance(1.0)
    for at in (0.5001, 0.5023):
        assert np.linalg.norm(body.attitude(at)[1:]) == pytest.approx(1.0, abs=1e-4)


SLOW = 20.0  # s; a busy machine


@pytest.fixture
def port(tmp_path):
    done = threading.Event()
    words = {"stop": done.is_set, "rate": 50.0, "log": str(tmp_path / "log")}
    thread = threading.Thread(target=khepera3, args=(tmp_path / "port",), kwargs=words)
    thread.start()
    path = tmp_path / "port"
    while not (tmp_path / "port.mishaps").exists():
        time.sleep(0.01)
    yield path
    done.set()
    thread.join()


def tell(port, word):
    with open(f"{port}.mishaps", "w") as pipe:
        pipe.write(word + "\n")


def test_what_a_camera_may_do(port, waited):
    camera = EmulatedCamera(port, painter("khepera3", Camera.overhead((320, 240))))

    def pair():
        one, two = camera.read(SLOW), camera.read(SLOW)
        return two.time - one.time, np.array_equal(one.image, two.image)

    assert pair()[0] > 0 and not pair()[1]
    tell(port, "frozen")
    assert waited(lambda: pair()[1])
    assert pair()[0] > 0  # its time stamps go on
    tell(port, "frozen")
    assert waited(lambda: not pair()[1])
    tell(port, "stale")
    assert waited(lambda: pair()[0] == 0 and not pair()[1])
    tell(port, "stale")
    tell(port, "covered")
    assert waited(lambda: camera.read(0.3) is None)
    camera.close()


def test_what_a_line_may_do(port, waited):
    line = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def heard():
        try:
            return os.read(line, 65536)
        except BlockingIOError:
            return b""

    def answers():
        os.write(line, b"B\n")
        time.sleep(0.1)
        return b"b,2,5" in heard()

    assert waited(answers)
    tell(port, "power")
    assert waited(lambda: not answers())
    tell(port, "power")
    assert waited(answers)  # it has booted
    tell(port, "flood")
    assert waited(lambda: len(heard()) > 100)
    tell(port, "nonsense")
    tell(port, "cable")
    assert waited(lambda: not os.path.exists(port))
    os.close(line)
    assert set(WORDS) >= {"stuck", "reset"}
