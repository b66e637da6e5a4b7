"""Tracking on drawn pictures, whose poses are known."""

import json

import numpy as np
import pytest

pytest.importorskip("cv2")

from bns.errors import BnsError, FormatError
from bns.hardware.emulators.camera import Painter
from bns.hardware.tracking import calibrate
from bns.hardware.tracking.camera import Camera
from bns.hardware.tracking.marker import Floor, Marker
from bns.hardware.tracking.tracker import Frame, Tracker

SIZE = (1280, 720)
POSES = [(0.0, 0.0, 0.0), (0.9, -0.4, 2.5), (-1.0, 0.5, -0.7), (0.3, 0.6, 1.57)]


@pytest.fixture(scope="module")
def painter():
    return Painter(Camera.overhead(SIZE), Marker())


def seen(tracker, painter):
    found = [tracker.see(Frame(0.0, painter.paint(p), i)) for i, p in enumerate(POSES)]
    assert all(found)
    return found


def test_poses_are_right_to_a_fraction_of_a_millimetre(painter):
    for found, pose in zip(
        seen(Tracker(painter.camera, Marker()), painter), POSES, strict=True
    ):
        assert np.hypot(*(found.pose[:2] - pose[:2])) < 3e-4
        turn = (found.pose[2] - pose[2] + np.pi) % (2 * np.pi) - np.pi
        assert abs(turn) < np.deg2rad(0.5)


def test_a_wrong_height_shifts_the_edge_and_is_found_out(painter):
    low = Marker(height=0.0517)
    found = seen(Tracker(painter.camera, low), painter)
    assert np.hypot(*(found[1].pose[:2] - POSES[1][:2])) > 5e-3
    image = painter.paint(None)
    said = calibrate.height(found, painter.camera, low, image=image, floor=Floor())
    assert not said.agrees
    assert said.height == pytest.approx(0.0717, abs=0.006)
    right = seen(Tracker(painter.camera, Marker()), painter)
    told = calibrate.height(right, painter.camera, Marker(), image=image, floor=Floor())
    assert told.agrees


def test_the_cameras_place_comes_from_the_floor_tags(painter):
    found = calibrate.place(painter.paint(None), painter.camera, Floor())
    assert np.abs(found.position - painter.camera.position).max() < 3e-3
    blank = np.full((720, 1280), 200, np.uint8)
    with pytest.raises(BnsError, match="0 of 6 floor tags"):
        calibrate.place(blank, painter.camera, Floor())


def test_no_tag_no_sighting(painter):
    tracker = Tracker(painter.camera, Marker())
    assert tracker.see(Frame(0.0, painter.paint(None), 0)) is None
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
