"""What every robot directory has to be; a new one is picked up by itself."""

import os

import pytest

from bns import models
from bns.errors import FormatError, OutOfBoundsError, UnknownNameError
from bns.models import check, mjcf, numbers

FILES = ("README.md", "CHANGELOG.md", "robot.toml", "numbers.toml", "scene.xml")

robots = pytest.mark.parametrize("name", models.names())


@pytest.fixture(scope="module")
def compiled():
    return {name: models.spec(name).compile() for name in models.names()}


@robots
def test_every_point_of_the_check_holds(name):
    points = check.check(models.robot(name))
    assert [point for point in points if point.faults] == []
    assert len(points) == 2 + len(check.POINTS)


@robots
def test_directory_is_complete(name):
    directory = models.path(name)
    wanted = [*FILES, f"{name}.xml", f"{name}.png"]
    assert [file for file in wanted if not (directory / file).is_file()] == []
    assert f"{name}.png" in (directory / "README.md").read_text()


@robots
def test_a_wrong_number_is_noticed(name, compiled):
    item = next(iter(numbers.read(models.path(name)).values()))
    wrong = numbers.Number(**{**vars(item), "value": item.value * 1.001})
    assert wrong.disagreements(compiled[name])


@robots
def test_readme_names_what_is_not_published(name):
    readme = (models.path(name) / "README.md").read_text()
    table = numbers.read(models.path(name))
    own = [item.name for item in table.values() if item.basis != "published"]
    assert [item for item in own if f"`{item}`" not in readme] == []


def test_robots_without_a_floor_have_none():
    spec = models.spec("khepera3", scene=False)
    assert "floor" not in [geom.name for geom in spec.geoms]
    spec.compile()


def test_unknown_names_are_refused_with_what_exists():
    for call in (models.robot, models.path, models.spec, models.scene_spec):
        with pytest.raises(UnknownNameError, match="Did you mean 'khepera3'"):
            call("khepera")
    with pytest.raises(UnknownNameError, match="option of khepera3"):
        models.spec("khepera3", ir_tabel="thesis")
    with pytest.raises(UnknownNameError, match="public, thesis"):
        models.spec("khepera3", ir_table="webots")
    assert not issubclass(UnknownNameError, OutOfBoundsError)


def test_a_directory_is_a_robot(tmp_path):
    from bns.errors import FormatError
    from bns.models import robot_model

    made = tmp_path / "beetle"
    made.mkdir()
    (made / "robot.toml").write_text('kind = "wheeled"\n')
    with pytest.raises(FormatError, match="missing required field `doc`"):
        robot_model.read(made)


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
