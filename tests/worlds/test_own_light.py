"""A robot of the user's with light sensors: read, driven, damaged, diagnosed."""

import re
from pathlib import Path

import numpy as np
import pytest

from bns import models
from bns.errors import BnsError
from bns.gap import diagnose
from bns.gap.bench.light_cases import Wanderer
from bns.gap.models.wheeled.model import WheeledModel
from bns.models import check, new
from bns.worlds import registry
from bns.worlds.light import sensors as light_sensors
from bns.worlds.light.law import LightField
from tests.worlds.test_closed_loop import Seek


@pytest.fixture(scope="module")
def burger(tmp_path_factory):
    """A robot with eight light sensors."""
    return made(tmp_path_factory.mktemp("eight"))


@pytest.fixture(scope="module")
def braitenberg(tmp_path_factory):
    """The same with two of them."""
    place = made(tmp_path_factory.mktemp("two"))
    listed = [f'    "{name}",\n' for name in new.HEADINGS if name[-2:] != "45"]
    for text in listed:
        spoil(place, text, "")
    return place


def made(parent: Path) -> str:
    known = new.Wheeled(
        wheel_radius=0.033, axle_length=0.16, mass=1, top_speed=0.2, light_sensors=True
    )
    new.write(parent / "bug", known)
    return str(parent / "bug")


def spoil(place: str, old: str, instead: str) -> None:
    file = Path(place) / "robot.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, instead))


def test_two_sensors_are_the_virtual_two(braitenberg):
    sensors = light_sensors.of(braitenberg)
    assert sensors.names == ("ir_left_45", "ir_right_45")
    counts = sensors.counts(LightField(), np.array([[0.8, 0.1, 2.0], [0.4, -0.3, 1.0]]))
    assert (sensors.virtual(counts) == counts).all()
    assert len(np.unique(counts)) > 2


@pytest.mark.parametrize("robot", ["burger", "braitenberg"])
def test_it_finds_the_lamp(robot, request):
    world = registry.make("light", robot=request.getfixturevalue(robot))
    starts = [[0.9, 0.5, 1.0], [-0.8, 0.4, -2.0]]
    for trial in world.drive(Seek(), cycles=70, seeds=[1, 2], starts=starts):
        ways = np.hypot(*trial.poses_world[:, :2].T)
        assert ways[0] > 0.8
        assert ways.min() < 0.25


def test_numbers_of_its_own_count(burger, tmp_path):
    place = made(tmp_path)
    spoil(place, "full_light = 0.86", "full_light = 0.43")
    spoil(place, "exponent = 4.0", "exponent = 2.0")
    usual, own = light_sensors.of(burger), light_sensors.of(place)
    assert (own.full_light, own.exponent, own.count_noise) == (0.43, 2.0, 30.0)
    assert (usual.full_light, usual.exponent) == (0.86, 4.0)


def test_effects_take_the_sensors_that_are_there(braitenberg):
    told = {"cycles": 3, "seeds": [1], "starts": [[0.8, 0.2, 2.5]]}
    gain = "sensor_gain:sensor={},factor=0.5"
    plain, left, single = (
        registry.make("light", robot=braitenberg, damage=damage).drive(Seek(), **told)
        for damage in ((), [gain.format("left")], [gain.format("left_45")])
    )
    seen = [trial[0].channel("light_left")[0] for trial in (plain, left, single)]
    assert seen[1] == seen[2] == round(seen[0] / 2)
    with pytest.raises(BnsError, match="no sensor 'back'; it has left_45, right_45"):
        registry.make("light", robot=braitenberg, damage=[gain.format("back")])


@pytest.mark.parametrize(
    "old, instead, expected",
    [
        ('"ir_left_45",', '"tracker",', "'tracker' is none of"),
        ('    "ir_left_45",\n', "", "sensor 'ir_right_45' has no twin 'ir_left_45'"),
        (
            "full_light = 0.86",
            "full_light = -1",
            "full_light = -1.0 is no number above",
        ),
        ("exponent = 4.0", "exponents = 4.0", "exponents is none of exponent"),
        ("[light]", '[light]\nheadings = "thesis"', "headings"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, old, instead, expected):
    place = made(tmp_path)
    spoil(place, old, instead)
    if "headings" not in expected:
        points = check.check(models.robot(place))
        found = [text for point in points for text in point.faults]
        assert any(expected in text for text in found), found
    with pytest.raises(BnsError, match=expected):
        registry.make("light", robot=place)


def test_a_sensor_that_looks_up_is_refused(tmp_path):
    place = made(tmp_path)
    file = Path(place) / "bug.xml"
    site = r'(<site name="ir_left_45" .* zaxis=)"[^"]*"'
    text, count = re.subn(site, r'\1"0.7 0.7 0.5"', file.read_text())
    assert count == 1
    file.write_text(text)
    with pytest.raises(BnsError, match="'ir_left_45' looks up or down"):
        light_sensors.of(place)


@pytest.mark.parametrize("robot", ["burger", "braitenberg"])
def test_a_weak_sensor_is_named(robot, request):
    place = request.getfixturevalue(robot)
    world = registry.make(
        "light",
        robot=place,
        reality=[
            "sensor_gain:sensor=left,factor=0.7",
            "tracker_noise:position_sd=0.001",
        ],
    )
    roams = Wanderer(np.random.default_rng(3), 3)
    trials = world.drive(roams, cycles=40, seeds=[1, 2, 3])
    names = ("wheel_gain[left]", "sensor_gain[left]", "sensor_gain[right]")
    model = WheeledModel(place)
    found = diagnose.diagnose(trials, model, rows=names, full=False).verdict
    assert found.named == (("sensor_gain[left]",),)
