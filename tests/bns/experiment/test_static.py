"""Static nets: a known world is imitated, for wheels and for legs."""

from dataclasses import replace

import numpy as np
import pytest

from bns import models
from bns.errors import BnsError
from bns.experiment import static_snn
from bns.experiment.config import RunConfig
from bns.worlds import registry
from bns.worlds.effects.legs import RAISED
from bns.worlds.static_snn import StaticNets, kinematic_nets
from bns.worlds.trial import Commands
from tests.bns.robots import Slider, small


def test_imitates_a_known_world():
    source = registry.make("static-snn", robot="khepera3")
    nets = static_snn.fit(source, RunConfig(threads=1), lists=60, epochs=600)
    rng = np.random.default_rng(0)
    speeds = rng.uniform(0, 0.12, (200, 4))
    inputs = np.column_stack([speeds, rng.uniform(0.3, 3.1, 200)])
    miss = nets(inputs) - source.nets(inputs)
    assert (np.sqrt((miss**2).mean(0)) < [0.012, 0.012, 0.08]).all()
    assert nets.provenance["commands"] == 54 * static_snn.PER_LIST


@pytest.fixture(scope="module")
def nets():
    return static_snn.fit_walker(Slider(), small(), lists=80, steps=400)


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
    lists = static_snn.walker_commands(small(), 40)
    up = [(item.values[:, 1::3] == RAISED["femur"]).all(0).sum() for item in lists]
    assert 8 <= np.count_nonzero(up) <= 32
    assert max(up) <= static_snn.MOST_UP


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
