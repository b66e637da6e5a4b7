"""Walkers of the user's: with servos of their own, or two joints a leg.

They are checked, driven, damaged, diagnosed and refused.
"""

import re
import shutil

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import BnsError
from bns.gap.bench import cases
from bns.gap.bench.walk_cases import WalkStand
from bns.gap.candidates import legged
from bns.gap.models.legged.model import WalkModel
from bns.gap.models.legged.signs import Suspects
from bns.models import ax12a, check, legs, servo_numbers
from bns.models.legs import PARTS
from bns.worlds import registry
from bns.worlds.trial import Commands
from tests.sources import ROOT

QUAD = ROOT / "examples" / "quad"


@pytest.fixture
def walker(tmp_path):
    """Makes copies of the four-legged robot with servos of some numbers."""

    def make(**numbers: float) -> str:
        place = tmp_path / str(len(list(tmp_path.iterdir()))) / "quad"
        shutil.copytree(QUAD, place)
        text = (place / "robot.toml").read_text()
        assert text.count('servo = "ax12a"') == 1
        own = text.replace('servo = "ax12a"', f'servo = "{servo_numbers.LAW}"')
        (place / "robot.toml").write_text(own)
        rest = 'unit = "SI"\nbasis = "assumed"\nsource = "a test"\n'
        tables = (f"[{name}]\nvalue = {numbers[name]}\n{rest}" for name in numbers)
        (place / servo_numbers.LAW).write_text("\n".join(tables))
        return str(place)

    return make


def leaning(robot: str, *damage: str) -> np.ndarray:
    """Where everything is while the robot leans to its front, under damage."""
    channels = models.robot(robot).channels
    front = [channel.name.endswith("front_femur") for channel in channels]
    lean = Commands(np.where(front, 0.5, 0.0)[None], [1.0], channels)
    (trial,) = registry.make("hexapod", robot=robot, damage=damage).run([lean])
    return trial.observed


def test_servos_with_the_same_numbers_are_the_same(walker):
    own = leaning(walker())
    assert own.tobytes() == leaning(walker(**ax12a.law())).tobytes()
    # the example's model has five digits of what follows from the law
    assert own == pytest.approx(leaning(str(QUAD)), abs=1e-4)


def test_other_numbers_do_what_an_effect_that_leads_to_them_does(walker):
    weak = leaning(walker(voltage=0.5 * ax12a.law()["voltage"]))
    other = leaning(str(QUAD), "servo_voltage:factor=0.5")
    assert weak.tobytes() == other.tobytes()
    assert weak != pytest.approx(leaning(str(QUAD)), abs=1e-3)


def test_effects_compose_with_them(walker):
    own = walker(gain=0.5 * ax12a.law()["gain"])
    both = leaning(own, "servo_gain:factor=2")
    assert both.tobytes() == leaning(walker()).tobytes()
    limp = "leg_limp:legs=left_front"
    other = leaning(str(QUAD), "servo_gain:factor=0.5", limp)
    assert leaning(own, limp) == pytest.approx(other, abs=1e-4)


@pytest.mark.parametrize(
    "numbers, expected",
    [
        ({"voltages": 12.0}, "Did you mean 'voltage'"),
        ({"voltage": 120.0}, "servo voltage = 120"),
        ({"stribeck": 0.1}, "can not represent 'stribeck'"),
    ],
)
def test_numbers_that_can_not_be_are_refused(walker, numbers, expected):
    with pytest.raises(BnsError, match=expected):
        leaning(walker(**numbers))


def test_the_check_sees_what_is_wrong(walker, tmp_path):
    place = walker(voltage=12.0)
    file = tmp_path / "0" / "quad" / servo_numbers.LAW
    for text, expected in (
        ("[voltage]\nvalue = 12.0\n", "[voltage] in"),
        (file.read_text().replace("a test", ""), "lacks a source or unit"),
        (None, "cannot be read"),
    ):
        file.write_text(text) if text else file.unlink()
        servo_numbers._tables.cache_clear()
        points = check.check(models.robot(place))
        found = [fault for point in points for fault in point.faults]
        assert any(expected in fault for fault in found), found


DAMAGE = (
    "leg_raised:legs=2",
    "leg_limp:legs=1",
    "leg_missing:legs=3",
    "foot_slippery:legs=2,factor=0.1",
    "servo_gain:servo=femur,factor=0.4",
    "link_length:part=femur,factor=1.2",
)


def short(place, part: str):
    """The four-legged example with one joint of each leg welded."""
    shutil.copytree(QUAD, place)
    at, text = PARTS.index(part), (place / "quad.xml").read_text()
    text = re.sub(rf'\n *<(joint|position) name="\w+_{part}"[^>]*/>', "", text)
    found = re.search(r'qpos="([^"]*)"', text)
    values = found[1].split()
    joints = [value for i, value in enumerate(values[7:]) if i % 3 != at]
    text = text.replace(found[0], f'qpos="{" ".join(values[:7] + joints)}"')
    text = text.replace(f'ctrl="{" ".join("0" * 12)}"', f'ctrl="{" ".join("0" * 8)}"')
    (place / "quad.xml").write_text(text)
    facts = (place / "robot.toml").read_text()
    block = rf'\[\[commands\]\]\nname = "\w+_{part}"\n(?:.+\n)+\n?'
    (place / "robot.toml").write_text(re.sub(block, "", facts))
    numbers = (place / "numbers.toml").read_text()
    line = rf'\n"(joint|actuator) \w+_{part}[^"\n]*" = .*'
    (place / "numbers.toml").write_text(re.sub(line, "", numbers))
    return _at_rest(place)


def _at_rest(place):
    """With a home position that the other legs have settled to."""
    model = mujoco.MjModel.from_xml_path(str(place / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 1500)
    home = " ".join(map(repr, data.qpos.tolist()))
    file = place / "quad.xml"
    file.write_text(re.sub(r'qpos="[^"]*"', f'qpos="{home}"', file.read_text()))
    return place


@pytest.fixture(scope="module", params=["coxa", "tibia"])
def robot(request, tmp_path_factory):
    """Its directory; of legs that do not move by this part."""
    return short(tmp_path_factory.mktemp(request.param) / "quad", request.param)


def walked(robot, *damage: str) -> np.ndarray:
    """Where everything is while the robot is told two postures, under damage."""
    channels = models.robot(str(robot)).channels
    goals = np.random.default_rng(1).uniform(-0.4, 0.4, (2, 8))
    told = Commands(goals, [1.0, 1.0], channels)
    (trial,) = registry.make("hexapod", robot=str(robot), damage=damage).run([told])
    return trial.observed


def test_every_point_holds(robot):
    points = check.check(models.robot(str(robot)))
    assert not [fault for point in points for fault in point.faults]


@pytest.mark.parametrize("damage", DAMAGE)
def test_damage_moves_it_otherwise(robot, damage):
    hurt = walked(robot, damage)
    assert np.isfinite(hurt).all()
    assert np.abs(hurt[-1] - walked(robot)[-1]).max() > 1e-3


def test_joints_that_it_lacks_are_refused(robot):
    moved = legs.parts(c.name for c in models.robot(str(robot)).commands)
    (absent,) = set(PARTS) - set(moved)
    for damage in (
        f"link_length:part={absent},factor=1.1",
        f"servo_gain:servo={absent},factor=0.5",
        f"joint_locked:joint=left_rear_{absent},loss=1",
    ):
        with pytest.raises(BnsError, match=f"legs move by {' and '.join(moved)}"):
            walked(robot, damage)


def test_a_leg_that_is_held_up_is_seen_in_its_recordings(robot):
    model = WalkModel(str(robot))
    listed = [row.name for row in legged.rows(Suspects((), (), True), model.joints)]
    (absent,) = set(PARTS) - set(legs.parts(model.joints))
    assert not [name for name in listed if absent in name]
    case = cases.build(2, "lost", WalkStand(model))
    predicted = model.simulate(case.trials, [()])[0]
    named = [row.name for row in model.rows(case.trials)]
    assert case.answer.names[0] in named
    assert model.signs(case.trials, predicted).joints
