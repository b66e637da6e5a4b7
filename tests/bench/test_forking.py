"""A side that goes on from a trunk is the side trained from its first trial on."""

from dataclasses import replace

import pytest

from bench.learning import experiments, forking
from bns.experiment.config import AdaptationConfig, WorldConfig
from bns.experiment.config_watch import WatchConfig
from bns.experiment.run import train
from tests.bns.contents import contents
from tests.bns.light_fakes import small


def side(damage="wheel_gain:wheel=left,factor=0.5@2", **settings):
    config = small()
    world = WorldConfig(name="light", damage=(damage,))
    settings = {"adaptation": AdaptationConfig(population_reset=True)} | settings
    config = replace(config, preset="side", trials=4, world=world, **settings)
    return replace(config, record_replicates=0, seed=forking.seed(config))


@pytest.mark.parametrize("watch", [WatchConfig(), WatchConfig(detect=True, warmup=2)])
def test_it_has_the_same_bytes(tmp_path, monkeypatch, watch):
    monkeypatch.setattr(experiments, "RUNS", tmp_path)
    config = side(watch=watch)
    forking.grow(config)
    forking.branch(config)
    train(config, tmp_path / "straight")
    forked = contents(experiments.directory(config))
    straight = contents(tmp_path / "straight")
    assert forked == straight


def test_sides_of_a_trunk_differ_from_the_damage_on_only():
    one, other = side(), side("sensor_noise:factor=2@2", adaptation=AdaptationConfig())
    assert forking.trunk(one) == forking.trunk(other)
    windowed = side(adaptation=AdaptationConfig(window=30))
    assert forking.trunk(windowed) != forking.trunk(one)
    assert forking.seed(windowed) != forking.seed(one)


def test_what_a_false_alarm_sets_off_belongs_to_the_trunk():
    watched = WatchConfig(detect=True)
    reset, none = (
        side(watch=watched),
        side(watch=watched, adaptation=AdaptationConfig()),
    )
    assert forking.trunk(reset) != forking.trunk(none)
