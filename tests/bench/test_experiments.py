"""Experiments that benches share: runs that begin as copies, and what is printed."""

from dataclasses import replace

import numpy as np
import pytest

from bench.learning import experiments, forking, solving
from bns.errors import BnsError
from bns.experiment.config import WorldConfig
from bns.experiment.run import train
from bns.learners.bns.config import AdaptationConfig, WatchConfig
from bns.storage.store import RunStore
from tests.bns import robots
from tests.bns.robots import small
from tests.bns.shared import contents

ONSET = 6


def damaged(trunk, onset=ONSET, **changes):
    world = replace(trunk.world, damage=(f"leg_raised:legs=1,blend=1@{onset}",))
    settings = {"preset": "branch", "trials": ONSET + 2, "world": world}
    return replace(trunk, **settings | changes)


@pytest.fixture
def trunk(tmp_path, monkeypatch):
    monkeypatch.setattr(experiments, "RUNS", tmp_path)
    plain = replace(small().world, damage=())
    return small(preset="trunk", trials=ONSET, record_replicates=0, world=plain)


def test_a_branch_has_the_bytes_of_a_run_from_the_start(trunk, tmp_path):
    branch = damaged(trunk)
    train(trunk, experiments.directory(trunk))
    forking.begin(trunk, branch)
    place = experiments.directory(branch)
    assert len(list((place / "steps").iterdir())) == ONSET, "it goes on, not anew"
    train(branch, place, resume=True)
    train(branch, tmp_path / "whole")
    names = {path.name for path in (tmp_path / "whole").iterdir()} - {"timing.jsonl"}
    assert {"record.parquet", "arrays.npz", "state.npz"} <= names
    for name in names:
        if (place / name).is_file():
            wanted = (tmp_path / "whole" / name).read_bytes()
            assert (place / name).read_bytes() == wanted, name


@pytest.mark.parametrize(
    "changes", [{"onset": ONSET - 1}, {"seed": 5}, {"choose": "tournament"}]
)
def test_a_branch_that_differs_earlier_is_refused(trunk, changes):
    with pytest.raises(BnsError, match="branch is no continuation of trunk"):
        forking.begin(trunk, damaged(trunk, **changes))


def test_a_section_that_did_nothing_in_the_trunk_may_differ(trunk):
    branch = damaged(trunk, watch=replace(trunk.watch, forget=True))
    train(trunk, experiments.directory(trunk))
    with pytest.raises(BnsError, match="no continuation"):
        forking.begin(trunk, branch)
    forking.begin(trunk, branch, idle=("watch",))
    place = experiments.directory(branch)
    assert len(list((place / "steps").iterdir())) == ONSET
    assert RunStore.open(place).config.watch.forget
    record = train(branch, place, resume=True)
    assert not record["forgotten"][:, :ONSET].any()


def side(damage="wheel_gain:wheel=left,factor=0.5@2", **settings):
    config = robots.small_light()
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


def test_waiting_times_say_how_many_came():
    found = solving.waits(np.array([3.0, 1.0, np.inf, 2.0, np.inf]))
    assert (found["came"], found["of"], found["median"]) == (3, 5, 3.0)
    assert found["longest"] == 3.0 and found["interval"][1] is None


def test_a_ratio_of_pairs_that_all_have_it_is_sure():
    second = np.arange(1.0, 31.0)
    found = solving.ratio(second / 2, second)
    assert found == {"ratio": 0.5, "ratio interval": [0.5, 0.5]}


def test_the_interval_of_a_ratio_covers_it_at_about_its_nominal_rate():
    rng, covered = np.random.default_rng(0), 0
    for _ in range(60):
        trunk = rng.normal(size=30)
        first = np.exp(0.2 * trunk + 0.1 * rng.normal(size=30) + np.log(0.9))
        second = np.exp(0.2 * trunk + 0.1 * rng.normal(size=30))
        low, high = solving.ratio(first, second)["ratio interval"]
        covered += low <= 0.9 <= high
    assert 52 <= covered <= 60  # 57 expected
