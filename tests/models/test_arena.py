"""The arena: a board of the right size, objectives that only show, two cameras."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import MissingDependencyError, UnknownNameError
from bns.models import arena, render

PLACES = {"A": (-0.3, 0.3), "C": (0.3, -0.3), "start": (0.0, 0.0)}


def test_board_and_objectives():
    model = arena.spec(PLACES, radius=0.07).compile()
    np.testing.assert_allclose(model.geom("floor").size[:2], [1.35, 0.9])
    for name, place in PLACES.items():
        np.testing.assert_allclose(model.site(f"objective_{name}").pos[:2], place)
        assert model.geom(f"disc_{name}").size[0] == 0.07


def test_only_the_floor_can_be_touched():
    model = arena.spec(PLACES).compile()
    touchable = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    assert [model.geom(index).name for index in touchable] == ["floor"]


def test_overhead_camera_sees_the_whole_board():
    model = arena.spec().compile()
    camera = model.camera("overhead")
    height = np.tan(np.radians(camera.fovy[0] / 2)) * camera.pos[2]
    assert 0.9 < height < 1.0
    assert height * 3 / 2 > 1.35  # in a picture of 3:2


def test_the_robot_drives_on_the_board_as_in_its_scene():
    from bns.models import khepera3

    board = models.scene_spec("khepera3", objectives=PLACES)
    there = khepera3.measure(board)
    assert there == khepera3.measure(models.spec("khepera3"))


def test_bare_board_keeps_the_sites():
    bare = models.scene_spec("khepera3", objectives=PLACES, visuals=False).compile()
    assert bare.ngeom == 5 and bare.ncam == 0
    bare.site("objective_A")


def test_unknown_camera_is_refused():
    with pytest.raises(UnknownNameError, match="overhead, perspective"):
        render.picture(arena.spec(), camera="above")


@pytest.fixture(scope="module")
def pictures(opengl):
    """Overhead pictures without and with objectives."""
    size = (150, 100)
    return [
        render.picture(arena.spec(places), camera="overhead", size=size)
        for places in ({}, PLACES)
    ]


def test_objectives_are_seen_where_they_are(pictures):
    empty, shown = (picture.astype(int) for picture in pictures)
    assert empty.shape == (100, 150, 3)
    changed = np.abs(shown - empty).max(axis=2) > 30
    scale = 100 / (2 * 0.9 * 1.06)  # px per m
    for x, y in PLACES.values():
        row, column = round(50 - y * scale), round(75 + x * scale)
        assert changed[row - 2 : row + 3, column - 2 : column + 3].mean() > 0.5
    assert not changed[:15].any()  # nothing else changes


def test_the_board_is_white_and_fills_the_picture(pictures):
    empty = pictures[0].astype(int)
    assert empty[10:90, 10:140].min() > 200
    assert empty[0].max() < 200


def test_picture_is_written(tmp_path, pictures):
    from matplotlib.image import imread

    spec = models.spec("khepera3")
    made = render.picture(spec, tmp_path / "k.png", camera="portrait", size=(96, 72))
    stored = np.rint(imread(tmp_path / "k.png")[..., :3] * 255)
    np.testing.assert_array_equal(stored, made)
    assert len(np.unique(made.reshape(-1, 3), axis=0)) > 50


def test_no_opengl_says_what_to_install(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    monkeypatch.delattr(mujoco, "GLContext", raising=False)
    with pytest.raises(MissingDependencyError, match="apt-get install libegl1"):
        render.picture(arena.spec(), camera="overhead")
