"""A walking robot of the user's with servos of its own: `law.toml` beside its model."""

import shutil

import numpy as np
import pytest

from bns import models
from bns.errors import BnsError
from bns.models import ax12a, check, servo_numbers
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
