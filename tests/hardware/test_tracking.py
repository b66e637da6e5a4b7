"""Tracking on drawn pictures, whose poses are known, and robots that are emulated.

These are looked at at any moment, and told to have mishaps.
"""

import json
import os
import threading
import time

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.hardware.emulators.camera import EmulatedCamera, Painter, painter
from bns.hardware.emulators.khepera import KheperaBody
from bns.hardware.emulators.pty_host import WORDS
from bns.hardware.emulators.run import khepera3
from bns.hardware.tracking import calibrate
from bns.hardware.tracking.camera import Camera
from bns.hardware.tracking.marker import Floor, Marker
from bns.hardware.tracking.tracker import Frame, Tracker

pytest.importorskip("cv2")

SIZE = (1280, 720)
POSES = [(0.0, 0.0, 0.0), (0.9, -0.4, 2.5), (-1.0, 0.5, -0.7), (0.3, 0.6, 1.57)]


@pytest.fixture(scope="module")
def drawn():
    return Painter(Camera.overhead(SIZE), Marker())


def seen(tracker, drawn):
    found = [tracker.see(Frame(0.0, drawn.paint(p), i)) for i, p in enumerate(POSES)]
    assert all(found)
    return found


def test_poses_are_right_to_a_fraction_of_a_millimetre(drawn):
    for found, pose in zip(
        seen(Tracker(drawn.camera, Marker()), drawn), POSES, strict=True
    ):
        assert np.hypot(*(found.pose[:2] - pose[:2])) < 3e-4
        turn = (found.pose[2] - pose[2] + np.pi) % (2 * np.pi) - np.pi
        assert abs(turn) < np.deg2rad(0.5)


def test_a_wrong_height_shifts_the_edge_and_is_found_out(drawn):
    low = Marker(height=0.0517)
    found = seen(Tracker(drawn.camera, low), drawn)
    assert np.hypot(*(found[1].pose[:2] - POSES[1][:2])) > 5e-3
    image = drawn.paint(None)
    said = calibrate.height(found, drawn.camera, low, image=image, floor=Floor())
    assert not said.agrees
    assert said.height == pytest.approx(0.0717, abs=0.006)
    right = seen(Tracker(drawn.camera, Marker()), drawn)
    told = calibrate.height(right, drawn.camera, Marker(), image=image, floor=Floor())
    assert told.agrees


def test_the_cameras_place_comes_from_the_floor_tags(drawn):
    found = calibrate.place(drawn.paint(None), drawn.camera, Floor())
    assert np.abs(found.position - drawn.camera.position).max() < 3e-3
    blank = np.full((720, 1280), 200, np.uint8)
    with pytest.raises(BnsError, match="0 of 6 floor tags"):
        calibrate.place(blank, drawn.camera, Floor())


def test_no_tag_no_sighting(drawn):
    tracker = Tracker(drawn.camera, Marker())
    assert tracker.see(Frame(0.0, drawn.paint(None), 0)) is None
    assert tracker.loss.missed == 1


def test_a_distorted_camera_projects_and_comes_back(tmp_path):
    plain = Camera.overhead(SIZE)
    bent = Camera(
        SIZE, plain.matrix, np.array([-0.12, 0.03, 0, 0, 0]), plain.rotation,
        plain.position,
    )  # fmt: skip
    points = np.array([[1.0, 0.5, 0.07], [-1.2, 0.8, 0.07]])
    again = bent.on_plane(bent.project(points), 0.07)
    assert np.abs(again - points[:, :2]).max() < 1e-4
    bent.write(tmp_path / "c.json")
    held = Camera.read(tmp_path / "c.json")
    assert (held.distortion == bent.distortion).all()
    (tmp_path / "d.json").write_text("{}")
    with pytest.raises(FormatError, match="bns hardware calibrate"):
        Camera.read(tmp_path / "d.json")


@pytest.mark.parametrize(
    "change",
    [
        {"size": [1280, 0]},
        {"latency": -1.0},
        {"latency": 1e308},
        {"matrix": np.zeros((3, 3)).tolist()},
        {"rotation": (2 * np.eye(3)).tolist()},
        {"matrix": None},
    ],
    ids=str,
)
def test_a_camera_that_cannot_be_is_refused(tmp_path, change):
    Camera.overhead(SIZE).write(tmp_path / "c.json")
    held = json.loads((tmp_path / "c.json").read_text()) | change
    del held["sha256"]
    (tmp_path / "c.json").write_text(json.dumps(held))
    with pytest.raises(FormatError, match=r"c\.json"):
        Camera.read(tmp_path / "c.json")


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
