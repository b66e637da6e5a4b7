"""What every robot directory has to be, those of the project and those of a user."""

import os
import shutil

import numpy as np
import pytest

from bns import models
from bns.errors import BnsError, FormatError, OutOfBoundsError, UnknownNameError
from bns.models import check, mjcf, numbers, robot_model
from bns.worlds import registry
from bns.worlds.trial import Commands
from tests.sources import ROOT

FILES = ("README.md", "CHANGELOG.md", "robot.toml", "numbers.toml", "scene.xml")

robots = pytest.mark.parametrize("name", models.names())


@pytest.fixture(scope="module")
def compiled():
    return {name: models.spec(name).compile() for name in models.names()}


@robots
def test_every_point_of_the_check_holds(name):
    robot = models.robot(name)
    points = check.check(robot)
    assert [point for point in points if point.faults] == []
    said = " ".join(point.says for point in points)
    assert ("a wheeled robot" in said) == (robot.kind == "wheeled")
    assert ("a walking robot's legs" in said) == (robot.kind == "legged")
    others = {"wheeled": 1, "legged": 1, "servo": 2}[robot.kind]
    assert len(points) == 2 + len(check.POINTS) - others


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


BURGER, QUAD = ROOT / "examples" / "burger", ROOT / "examples" / "quad"


@pytest.fixture
def mine(tmp_path):
    """A copy of the burger that a test may spoil."""
    return shutil.copytree(BURGER, tmp_path / "burger")


@pytest.fixture
def walker(tmp_path):
    """A copy of the four-legged robot that a test may spoil."""
    return shutil.copytree(QUAD, tmp_path / "quad")


def faults(place) -> dict[str, tuple[str, ...]]:
    """What the check finds wrong, by what was checked."""
    points = check.check(models.robot(str(place)))
    return {point.says: point.faults for point in points if point.faults}


def spoil(place, file: str, old: str, new: str) -> None:
    text = (place / file).read_text()
    assert old in text
    (place / file).write_text(text.replace(old, new))


def test_a_robot_is_called_after_its_directory(mine):
    (found,) = faults(mine.rename(mine.with_name("mine"))).values()
    assert found == ("the robot alone is to be mine.xml, as its directory",)


@pytest.mark.parametrize("place", [BURGER, QUAD], ids=lambda place: place.name)
def test_every_point_holds(place):
    assert faults(place) == {}


@pytest.mark.parametrize(
    "file, old, new, expected",
    [
        ("burger.xml", 'axis="0 1 0"', 'axis="0 -1 0"', "goes -0.088 m/s"),
        ("burger.xml", 'pos="0 0.08 0.033"', 'pos="0 -0.08 0.033"', "spins by -1"),
        ("burger.xml", '<key name="home"', '<key name="rest"', "no key called 'home'"),
        ("burger.xml", "6.6667 6.6667", "5 5", "its actuator from -0.165 to 0.165"),
        ("burger.xml", 'mass="0.94474"', 'mass="1.2"', "body_mass: body burger mass"),
        ("burger.xml", "<worldbody>", "<worldbodies>", "cannot be read"),
        ("robot.toml", 'actuator = "left_wheel"\n\n[wheels.right]',
         'actuator = "left"\n\n[wheels.right]', "no actuator called 'left'"),
        ("robot.toml", 'kind = "wheeled"', 'kind = "flying"', "none of wheeled"),
        ("numbers.toml", "[body_mass.at]", "[body_mass.on]", "numbers.toml"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(mine, file, old, new, expected):
    spoil(mine, file, old, new)
    if expected.startswith("spins"):  # swap both wheels
        spoil(mine, file, 'right_wheel" pos="0 -0.08', 'right_wheel" pos="0 0.08')
    found = [text for item in faults(mine).values() for text in item]
    assert any(expected in text for text in found), found


@pytest.mark.parametrize(
    "file, old, new, expected",
    [
        ("robot.toml", 'name = "left_rear_tibia"', 'name = "left_rear_knee"',
         "no command is called 'left_rear_tibia'"),
        ("quad.xml", 'geom name="left_front_foot"', 'geom name="left_front_toe"',
         "no geom called 'left_front_foot'"),
        ("quad.xml", 'contact name="own"', 'contact name="other"', "called 'own'"),
        ("scene.xml", 'conaffinity="1"', 'conaffinity="2"', "not touch the floor"),
        ("quad.xml", 'geom contype="1"', 'geom contype="0"', "without what only shows"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_walker_is_said(walker, file, old, new, expected):
    spoil(walker, file, old, new)
    found = [text for item in faults(walker).values() for text in item]
    assert any(expected in text for text in found), found


def walked(*damage: str):
    """Where the four-legged robot is after leaning to its front, under damage."""
    channels = models.robot(str(QUAD)).channels
    front = [channel.name.endswith("front_femur") for channel in channels]
    lean = Commands(np.where(front, 0.4, 0.0)[None], [1.0], channels)
    return registry.make("hexapod", robot=str(QUAD), damage=damage).run([lean])[0]


def test_a_walker_stands_and_loses_a_leg():
    whole, less = walked(), walked("leg_missing:legs=right_front")
    assert not whole.outcome.fell and less.outcome.fell
    assert np.abs(whole.poses_world[-1][1:]).max() < 1e-3  # it leans straight ahead


@pytest.mark.parametrize(
    "damage, expected",
    [
        ("leg_raised:legs=5", "has no leg 5; it has left_front"),
        ("joint_locked:joint=left_middle_tibia", "has no leg 5"),
        ("servo_gain:servo=right_middle,factor=0.5", "has no leg 6"),
        ("leg_raised:legs=1,2,3,4", "take all 4 legs away"),
    ],
)
def test_legs_that_a_walker_lacks_are_refused(damage, expected):
    with pytest.raises(BnsError, match=expected):
        walked(damage)


def test_a_missing_table_of_numbers_is_a_fault(mine):
    (mine / "numbers.toml").unlink()
    assert any(
        "numbers.toml" in fault for item in faults(mine).values() for fault in item
    )


def test_it_drives_and_is_damaged():
    straight = Commands(np.full((1, 2), 0.12), [3.0])
    whole, weak = (
        registry.make("mujoco", robot=str(BURGER), damage=damage).run([straight])[0]
        for damage in ((), ("wheel_gain:wheel=left,factor=0.8",))
    )
    assert whole.robot == str(BURGER)
    x, y, _ = whole.poses_world[-1]
    assert 0.34 < x < 0.36 and abs(y) < 1e-3  # 0.36 m less the start
    # By hand: 10 % slower on average, turning left by 0.024 m/s over 0.16 m.
    turned = 3.0 * 0.2 * 0.12 / 0.16
    assert abs(weak.poses_world[-1][2] - turned) < 0.05 * turned


def test_what_is_no_robot_is_refused(tmp_path):
    with pytest.raises(FormatError, match="holds no robot"):
        models.robot(str(tmp_path))
    with pytest.raises(UnknownNameError, match="Or give a directory"):
        models.robot(str(tmp_path / "nowhere"))


def test_packages_register_theirs(monkeypatch):
    class Entry:
        name = "burger"

        def load(self):
            return type("package", (), {"__path__": [str(BURGER)]})

    robot_model.installed.cache_clear()
    monkeypatch.setattr(robot_model, "entry_points", lambda group: [Entry()])
    try:
        assert "burger" in models.names()
        assert robot_model.find("burger") == BURGER
    finally:
        robot_model.installed.cache_clear()
