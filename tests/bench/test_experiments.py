"""Experiments that benches share: runs that begin as copies, and what is printed.

What the walking benches count is tested on records and searches with known answers.
"""

from dataclasses import replace

import numpy as np
import pytest

from bench.learning import experiments, trunks
from bench.walking import ceiling, gait
from bench.walking import runs as hexapod_runs
from bns import presets
from bns.errors import BnsError
from bns.experiment.config import WorldConfig
from bns.experiment.record import RunRecord
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
    trunks.begin(trunk, branch)
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
        trunks.begin(trunk, damaged(trunk, **changes))


def test_a_section_that_did_nothing_in_the_trunk_may_differ(trunk):
    branch = damaged(trunk, watch=replace(trunk.watch, forget=True))
    train(trunk, experiments.directory(trunk))
    with pytest.raises(BnsError, match="no continuation"):
        trunks.begin(trunk, branch)
    trunks.begin(trunk, branch, idle=("watch",))
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
    return replace(config, record_replicates=0, seed=trunks.seed(config))


@pytest.mark.parametrize("watch", [WatchConfig(), WatchConfig(detect=True, warmup=2)])
def test_it_has_the_same_bytes(tmp_path, monkeypatch, watch):
    monkeypatch.setattr(experiments, "RUNS", tmp_path)
    config = side(watch=watch)
    trunks.grow(config)
    trunks.branch(config)
    train(config, tmp_path / "straight")
    forked = contents(experiments.directory(config))
    straight = contents(tmp_path / "straight")
    assert forked == straight


def test_sides_of_a_trunk_differ_from_the_damage_on_only():
    one, other = side(), side("sensor_noise:factor=2@2", adaptation=AdaptationConfig())
    assert trunks.trunk(one) == trunks.trunk(other)
    windowed = side(adaptation=AdaptationConfig(window=30))
    assert trunks.trunk(windowed) != trunks.trunk(one)
    assert trunks.seed(windowed) != trunks.seed(one)


def test_what_a_false_alarm_sets_off_belongs_to_the_trunk():
    watched = WatchConfig(detect=True)
    reset, none = (
        side(watch=watched),
        side(watch=watched, adaptation=AdaptationConfig()),
    )
    assert trunks.trunk(reset) != trunks.trunk(none)


def test_waiting_times_say_how_many_came():
    found = experiments.waits(np.array([3.0, 1.0, np.inf, 2.0, np.inf]))
    assert (found["came"], found["of"], found["median"]) == (3, 5, 3.0)
    assert found["longest"] == 3.0 and found["interval"][1] is None


def test_a_ratio_of_pairs_that_all_have_it_is_sure():
    second = np.arange(1.0, 31.0)
    found = experiments.ratio(second / 2, second)
    assert found == {"ratio": 0.5, "ratio interval": [0.5, 0.5]}


def test_the_interval_of_a_ratio_covers_it_at_about_its_nominal_rate():
    rng, covered = np.random.default_rng(0), 0
    for _ in range(60):
        trunk = rng.normal(size=30)
        first = np.exp(0.2 * trunk + 0.1 * rng.normal(size=30) + np.log(0.9))
        second = np.exp(0.2 * trunk + 0.1 * rng.normal(size=30))
        low, high = experiments.ratio(first, second)["ratio interval"]
        covered += low <= 0.9 <= high
    assert 52 <= covered <= 60  # 57 expected


def record(ways, *, seconds=10.0, onset=-1):
    ways = np.array(ways, float)
    runs, trials = ways.shape
    zeros = np.zeros((runs, trials, 12, 3))
    return RunRecord(
        config=small(replicates=runs, trials=trials),
        versions={},
        columns={"distance": ways, "seconds": np.full(ways.shape, seconds)},
        sent=zeros[:, :, :11],
        poses=zeros,
        predicted=zeros,
        damage_onset=np.full(runs, onset),
        directory="",
        conditions={},
    )


def test_a_walk_that_takes_twice_as_long_counts_half_and_a_short_one_as_it_is():
    slow, fast = record([[1.0]], seconds=16.0), record([[1.0]], seconds=4.0)
    assert hexapod_runs.in_time(slow, 8.0) == 0.5
    assert hexapod_runs.in_time(fast, 8.0) == 1.0


def test_the_first_trial_that_did_it_is_counted_from_one():
    hit = np.array([[True, False], [False, True], [False, False]])
    assert experiments.first(hit).tolist() == [1.0, 2.0, np.inf]


def test_regained_is_nine_tenths_of_the_median_before_the_damage():
    before = [1.0] * 9 + [9.0]  # one lucky trial does not raise the bar
    runs = [[*before, 0.89, 0.9, 1.0], [*before, 0.95, 0, 0], [*before, 0, 0, 0.8]]
    found = hexapod_runs.trials_to_regain(record(runs, onset=10))
    assert found.tolist() == [2.0, 1.0, np.inf]


def test_batches_are_joined_in_order():
    both = hexapod_runs.joined([record([[1, 2]]), record([[3, 4], [5, 6]])])
    assert both.replicates == both.config.replicates == 3
    assert both["distance"].tolist() == [[1, 2], [3, 4], [5, 6]]


def test_damaged_runs_continue_the_undamaged_ones():
    trunk, branch = hexapod_runs.undamaged("a"), hexapod_runs.damaged("type5", "a")
    assert trunk.seed == branch.seed != hexapod_runs.undamaged("b").seed
    assert branch.trials == trunk.trials + hexapod_runs.AFTER
    assert branch.adaptation.window == trunk.adaptation.window == 300
    assert branch.world.damage == ("leg_raised:legs=type5,blend=1@100",)


def test_runs_that_forget_differ_in_that_alone():
    plain, other, own = (
        hexapod_runs.damaged("type2", kind=kind) for kind in ("window", "forget", "own")
    )
    assert other.watch.forget and not plain.watch.forget
    assert replace(other, watch=plain.watch, preset=plain.preset) == plain
    recover = presets.load("hexapod-recover")
    assert replace(own, walk=plain.walk, preset=other.preset) == other
    assert (own.walk, own.watch) == (recover.walk, recover.watch)


def test_runs_with_a_model_continue_undamaged_ones_with_it():
    trunk = hexapod_runs.undamaged("a", preset=hexapod_runs.OWN)
    branch = hexapod_runs.damaged("type2", kind="nominal")
    assert trunk.walk.nominal and trunk.evolve_from == 1
    assert not hexapod_runs.undamaged("a").walk.nominal
    world = replace(branch.world, damage=())
    alike = replace(branch, preset=trunk.preset, trials=trunk.trials, world=world)
    assert alike == trunk


def test_the_first_trial_with_fewer_patterns_is_when_it_forgot():
    runs = record(np.zeros((3, 5)), onset=2)
    counts = [[11, 22, 33, 22, 33], [30, 30, 30, 30, 30], [22, 33, 33, 33, 22]]
    runs.columns["patterns"] = np.array(counts, float)
    assert gait._forgot(runs).tolist() == [2.0, np.inf, 3.0]


def test_what_a_learner_would_have_forgotten_is_told_from_its_record():
    walk = np.random.default_rng(0).uniform(-0.5, 0.5, (11, 18))
    sent = np.tile(walk, (2, 12, 1, 1))  # the same in every trial
    runs = replace(record(np.zeros((2, 12))), sent=sent)
    runs.poses[..., 0] = np.linspace(0, 1, 12)
    runs.poses[1, 9:] *= -1.0  # the second robot goes the other way from trial 9 on
    assert not hexapod_runs.forgets(runs)[0].any()
    assert hexapod_runs.forgets(runs)[1].argmax() == 10  # one trial says nothing


def test_until_counts_trials_to_shares_of_the_ceilings_that_are_known(monkeypatch):
    known = {("type2", None): 2.0, ("type2", ceiling.REACH): 1.0}
    monkeypatch.setattr(ceiling, "known", lambda *key: known.get(key))
    ways = np.array([[0.4, 0.6, 1.0], [0.2, 1.2, 1.6]])
    found = gait.until(ways, "type2")
    full, within = found["in full"], found["within the preset's reach"]
    assert (full["50%"]["median"], full["75%"]["came"]) == (2.5, 1)
    assert full["90%"]["came"] == 0
    assert (within["50%"]["median"], within["90%"]["median"]) == (2.0, 2.5)
    assert ceiling.shares(ways[:, 2], "type2")["in full"]["least"] == 0.5
    assert gait.until(ways, "type1") == {}


@pytest.mark.parametrize("reach", [None, 0.4])
def test_the_search_climbs_and_stays_within_the_stops(monkeypatch, reach):
    goal = np.full((2, 18), 0.5)
    goal[0, 0] = 99.0  # beyond the stop

    def distances(lists, legs):
        assert legs == "type0"
        return np.array([10.0 - np.abs(np.clip(goal, -3, 3) - x).mean() for x in lists])

    monkeypatch.setattr(ceiling, "distances", distances)
    start = np.zeros((2, 18))
    goals, farthest, step = ceiling.search(
        start, "type0", step=0.1, seed=1, generations=20, reach=reach
    )
    assert 0 < step < 1
    assert farthest > distances([start], "type0")[0] + 0.05
    assert farthest == pytest.approx(distances([goals], "type0")[0])
    from bns import models

    low, high = models.robot("phantomx").ranges.T
    assert (goals >= low).all() and (goals <= high).all()
    assert (np.abs(goals).max() > 0.4) == (reach is None)


def test_a_robot_that_stands_stands_on_its_feet():
    feet, *others = gait.shares([np.zeros((1, 18))])[0]
    assert feet == pytest.approx(1.0)
    assert others == [0.0, 0.0, 0.0]
