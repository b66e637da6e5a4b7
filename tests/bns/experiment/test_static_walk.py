"""Static nets for walking: a known world is imitated, and raised legs are known."""

from dataclasses import replace

import numpy as np
import pytest

from bns import models
from bns.errors import BnsError
from bns.experiment import static_walk as static
from bns.worlds import registry
from bns.worlds.effects.legs.whole import RAISED
from bns.worlds.static_snn.nets import StaticNets, kinematic_nets
from bns.worlds.trial import Commands
from tests.bns.walkers import Slider, small


@pytest.fixture(scope="module")
def nets():
    return static.fit(Slider(), small(), lists=80, steps=400)


def told(value=0.2, count=3):
    channels = models.robot("phantomx").channels
    values = np.full((count, 18), value)
    values[1::2] *= -1.0
    return Commands(values, np.ones(count), channels)


def walk(nets, commands, **settings):
    world = registry.make("static-snn", robot="phantomx", nets=nets, **settings)
    return world.run([commands])[0]


def test_a_known_world_is_imitated(nets):
    forward, left, turn = nets.provenance["held_out_explained"]
    assert forward > 0.3, "a second's worth of training"
    assert left == turn == 1.0, "it never goes that way"
    assert nets.provenance["commands"] == 72 * 11
    near = walk(nets, told()).poses_world[-1, 0]
    assert near == pytest.approx(Slider().run([told()])[0].poses_world[-1, 0], rel=0.4)


def test_a_raised_leg_acts_as_the_pose_it_takes_before_the_first_command_too(nets):
    hurt = walk(nets, told(), damage=["leg_raised:legs=5,blend=1@0"])
    values = told().values.copy()
    values[:, 12:15] = list(RAISED.values())
    home = np.zeros(18)
    home[12:15] = list(RAISED.values())
    seen = np.column_stack([np.vstack([home, values[:-1]]), values])
    first = nets(seen)[0]
    np.testing.assert_allclose(hurt.poses_world[1], first, atol=1e-12)
    assert not np.allclose(walk(nets, told()).poses_world[1], first, atol=1e-4)


def test_lists_have_legs_up_in_a_part_of_them():
    lists = static.commands(small(), 40)
    up = [(item.values[:, 1::3] == RAISED["femur"]).all(0).sum() for item in lists]
    assert 8 <= np.count_nonzero(up) <= 32
    assert max(up) <= static.MOST_UP


def test_rectified_units_survive_a_file(nets, tmp_path):
    nets.save(tmp_path / "nets.npz")
    seen = np.random.default_rng(0).uniform(-1, 1, (5, 36))
    again = StaticNets.load(tmp_path / "nets.npz")
    np.testing.assert_array_equal(again(seen), nets(seen))
    assert not np.allclose(replace(nets, activation="sigmoid")(seen), nets(seen))


@pytest.mark.parametrize(
    "given,says",
    [
        (None, "has no ideal networks: give `nets`"),
        (
            kinematic_nets(patterns=50, hidden=5),
            "have 5 inputs, robot 'phantomx' needs",
        ),
    ],
)
def test_networks_that_are_not_for_it_are_refused(given, says):
    with pytest.raises(BnsError, match=says):
        registry.make("static-snn", robot="phantomx", nets=given)
