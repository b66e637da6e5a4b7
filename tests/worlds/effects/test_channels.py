"""Effects on channels of commands, against answers that are known beforehand."""

import numpy as np
import pytest

from bns.worlds.effects import registry
from tests.worlds.effects.subjects import told


@pytest.mark.parametrize("name, channel", [("left_speed", 0), ("right_speed", 1)])
def test_a_limit_cuts_one_channel(name, channel):
    signal = told(("left_speed", "right_speed"))
    effect = registry.make("command_limit", part=name, limit=0.05)
    on = np.ones(len(signal.times), bool)
    made = effect.apply(signal, on, np.random.default_rng(0))
    other = 1 - channel
    assert np.abs(made[:, channel]).max() == 0.05
    assert (made[:, other] == signal.values[:, other]).all()


def test_a_milder_limit_is_wider():
    limit = registry.make("command_limit", limit=0.1)
    assert limit.scaled(0.5)["limit"] == pytest.approx(0.2)
    assert limit.scaled(0.0).is_nominal


def test_a_rate_limit_takes_its_time():
    effect = registry.make("command_rate", time_per_unit=0.5)  # 2 rad/s
    step = np.r_[np.zeros(10), np.ones(90)]
    made = effect.change(step, 0.01)
    assert made[9] == 0 and made[10] == pytest.approx(0.02)
    assert made[58] == pytest.approx(0.98) and made[59] == 1.0


def test_play_is_gone_through_where_a_command_turns_back():
    effect = registry.make("command_play", width=0.2)
    told = np.array([0.0, 0.05, 0.5, 0.45, 0.25, 0.45])
    made = effect.change(told, 0.01)
    assert made == pytest.approx([0.0, 0.0, 0.4, 0.4, 0.35, 0.35])
    assert registry.make("command_play", width=0.0).change(told, 0.01) == pytest.approx(
        told
    )


def test_a_dead_zone_takes_its_size_off_and_a_dead_band_does_not():
    signal = np.array([-0.3, -0.1, 0.05, 0.3])
    zone = registry.make("command_dead_zone", size=0.1).change(signal, 0.01)
    assert zone == pytest.approx([-0.2, 0.0, 0.0, 0.2])
    band = registry.make("command_dead_band", size=0.1).change(signal, 0.01)
    assert band == pytest.approx([-0.3, -0.1, 0.0, 0.3])
