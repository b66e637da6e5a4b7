"""Sizes of wheels and axle from encoders and tracker."""

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.hardware.driving import odometry
from bns.hardware.driving.odometry import Wheels, fit
from bns.models.khepera3 import WHEEL_DIAMETER


def moved(left, right, *, sizes, axle):
    """Motion of drives with constant speeds, ``(N, 3)``."""
    way = (sizes[0] * left + sizes[1] * right) / 2
    turn = (sizes[1] * right - sizes[0] * left) / axle
    chord = way * np.sinc(turn / (2 * np.pi))
    return np.column_stack([chord * np.cos(turn / 2), chord * np.sin(turn / 2), turn])


def ways():
    table = np.array(odometry.DRIVES)
    return table[:, :2] * table[:, 2:]


def test_known_sizes_are_found_and_kept(tmp_path):
    given = ways()
    seen = moved(*given.T, sizes=(1.02, 0.99), axle=0.0850)
    seen += np.random.default_rng(3).normal(0, [2e-4, 2e-4, 1e-3], seen.shape)
    found = fit(given, seen)
    assert found.factors == pytest.approx((1.02, 0.99), abs=2e-3)
    assert found.axle == pytest.approx(0.0850, abs=2e-4)
    assert 0 < found.error[0] < 1e-4
    found.write(tmp_path / "wheels.json")
    assert Wheels.read(tmp_path / "wheels.json") == found


def test_a_robot_that_is_none_is_refused(tmp_path):
    with pytest.raises(BnsError, match="off nominal"):
        fit(ways(), moved(*ways().T, sizes=(1.3, 1.3), axle=0.088))
    with pytest.raises(BnsError, match="four"):
        fit(ways()[:2], np.zeros((2, 3)))
    Wheels(left=2 * WHEEL_DIAMETER, right=WHEEL_DIAMETER, axle=0.088).write(
        tmp_path / "odd.json"
    )
    for name, words in (("odd.json", "nominal size"), ("none.json", "cannot be read")):
        with pytest.raises(FormatError, match=words):
            Wheels.read(tmp_path / name)


@pytest.mark.parametrize("change", ['"axle": 0', '"axle": NaN', '"left": "wide"'])
def test_wheels_that_cannot_be_are_refused(tmp_path, change):
    text = '{"format": "bns-wheels", "left": 0.041, "right": 0.041, "axle": 0.0884,'
    text += f' "error": [0, 0, 0], {change}}}'
    (tmp_path / "wheels.json").write_text(text)
    with pytest.raises(FormatError, match=r"wheels\.json"):
        Wheels.read(tmp_path / "wheels.json")
