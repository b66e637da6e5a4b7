"""MJCF files that ask for too much are refused before anything is built of them."""

import os

import pytest

from bns.errors import FormatError
from bns.models import mjcf

TEXT = "<mujoco>{}<worldbody>{}</worldbody></mujoco>"
TOO_MUCH = {
    "height field": (
        '<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>',
        "",
    ),
    "texture": (
        '<asset><texture type="2d" builtin="flat" width="90000" height="90000"/>'
        "</asset>",
        "",
    ),
    "replicate": ("", '<replicate count="1000000"><geom size="1"/></replicate>'),
    "nested": (
        "",
        '<replicate count="1000"><replicate count="1000"><geom size="1"/>'
        "</replicate></replicate>",
    ),
    "memory": ('<size memory="40G"/>', ""),
    "pipe": ('<asset><mesh name="m" file="pipe.stl"/></asset>', ""),
    "itself": ('<include file="robot.xml"/>', ""),
}


@pytest.mark.parametrize("case", TOO_MUCH)
def test_what_asks_for_too_much_is_refused(tmp_path, case):
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "robot.xml").write_text(TEXT.format(*TOO_MUCH[case]))
    with pytest.raises(FormatError):
        mjcf.load(tmp_path / "robot.xml")


def test_what_does_not_is_read(tmp_path):
    text = TEXT.format("", '<replicate count="3"><geom size="1"/></replicate>')
    (tmp_path / "robot.xml").write_text(text)
    assert mjcf.compiled(mjcf.load(tmp_path / "robot.xml"), "robot").ngeom == 3
