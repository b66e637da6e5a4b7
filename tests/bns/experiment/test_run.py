"""The run loop in memory, runs that were stopped or killed, learning beside a robot."""

import errno
import os
from dataclasses import replace

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError
from bns.experiment.batch import Batch, behind
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.loading import with_learner
from bns.experiment.run import train, train_many
from bns.experiment.world_factory import make_world
from bns.learners import registry as learners
from bns.learners.bns.config import AdaptationConfig, EvolutionConfig, SnnConfig
from bns.learners.bns.learner import LEAST
from bns.storage import files
from bns.storage.store import load
from bns.worlds import registry
from bns.worlds.trial import WHEEL_CHANNELS
from tests.bns.shared import contents
from tests.sources import ROOT

LEFT = "wheel_gain:wheel=left,factor=0.5@1"
RIGHT = "wheel_gain:wheel=right,factor=0.5@2"
TINY = RunConfig(
    snn=SnnConfig(epochs=2), trials=3, replicates=2, evolve_from=9,
    compiled="no", threads=1,
)  # fmt: skip


def test_several_configurations_keep_their_own_damage_and_window():
    configs = [
        replace(
            TINY,
            adaptation=AdaptationConfig(window=window),
            world=WorldConfig(damage=(damage,)),
        )
        for window, damage in ((0, LEFT), (8, RIGHT))
    ]
    records = train_many(configs)
    assert [record.config for record in records] == configs
    left, right = records
    np.testing.assert_array_equal(left.damage_onset, [1, 1])
    np.testing.assert_array_equal(left["damaged"], [[0, 1, 1]] * 2)
    np.testing.assert_array_equal(right["damaged"], [[0, 0, 1]] * 2)
    assert right["patterns"].max() <= 8 < left["patterns"].max()
    # the damaged world executes what was sent with half a wheel
    for record, trial, sign in ((left, 1, 1), (right, 2, -1)):
        turned = record.poses[:, trial, 1, 2]
        speeds = record.sent[:, trial, 0]
        halved = speeds[:, :2] * ([0.5, 1.0] if sign > 0 else [1.0, 0.5])
        ideal = (halved[:, 1] - halved[:, 0]) * speeds[:, 2] / 0.0884
        np.testing.assert_allclose(turned, ideal, atol=0.25)


def test_configurations_that_cannot_share_a_batch():
    with pytest.raises(BnsError, match="differ"):
        train_many([TINY, replace(TINY, snn=SnnConfig(epochs=3))])


def test_a_world_of_ones_own_is_all_the_learner_needs():
    asked = []

    class Recorder:
        name, robot = "mine", "khepera3"
        inner = make_world(TINY)

        def run(self, commands, *, trial=0, seeds=()):
            asked.append((trial, len(commands), tuple(seeds)))
            assert commands[0].channels == WHEEL_CHANNELS
            return self.inner.run(commands, trial=trial, seeds=seeds)

    record = train(TINY, world=Recorder())
    np.testing.assert_array_equal(record.poses, train(TINY).poses)
    assert {trial for trial, _, _ in asked} == {0, 1, 2}
    assert len({seeds for _, _, seeds in asked}) == len(asked), "a seed used twice"
    assert {count for _, count, _ in asked} == {2}


FAKES = ROOT / "tests" / "bns" / "fakes.py"
KILLED = -9


@pytest.fixture
def clean(fakes, tmp_path):
    """The contents of a run that nothing disturbed."""
    fakes.train(tmp_path / "clean")
    return contents(tmp_path / "clean")


# Writes of the fake run: config.toml, run.json, four times step and state, arrays, the
# dataset and its three files, record.
@pytest.mark.parametrize(
    ("write", "moment"),
    [(2, "before"), (2, "beside"), (3, "beside"), (4, "before"), (4, "after"),
     (10, "after"), (12, "beside"), (12, "after"), (14, "beside"), (16, "beside"),
     (16, "after")],
)  # fmt: skip
def test_killed_run_resumes_to_the_same_bytes(
    fakes, clean, run_python, tmp_path, write, moment
):
    run_python(FAKES, tmp_path / "run", write, moment, code=KILLED)
    assert contents(tmp_path / "run") != clean
    fakes.train(tmp_path / "run", resume=True)
    assert contents(tmp_path / "run") == clean


def test_stopped_run_resumes_to_the_same_bytes(fakes, clean, tmp_path):
    asked = iter([False, False, True])
    record = fakes.train(tmp_path / "run", stop=lambda: next(asked))
    assert record.trials == 2
    assert load(tmp_path / "run").trials == 2
    fakes.train(tmp_path / "run", resume=True)
    assert contents(tmp_path / "run") == clean


def test_memory_and_directory_hold_the_same_record(fakes, tmp_path):
    inside = fakes.train(None)
    for record in (fakes.train(tmp_path / "run"), load(tmp_path / "run")):
        assert set(record.columns) == set(inside.columns)
        for name, values in inside.columns.items():
            np.testing.assert_array_equal(record[name], values)
        np.testing.assert_array_equal(record.poses, inside.poses)
        np.testing.assert_array_equal(record.damage_onset, [2, 2, 2])


@pytest.mark.parametrize("write", [1, 2, 3, 6, 11, 12])
def test_full_disk_stops_with_a_message_and_loses_nothing(
    fakes, clean, tmp_path, monkeypatch, write
):
    count, sync = 0, os.fsync

    def full(handle):
        nonlocal count
        count += 1
        if count == 2 * write - 1:  # a file and its directory are synchronised
            raise OSError(errno.ENOSPC, "No space left on device")
        sync(handle)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(files.StorageError, match=r"No space left.*--resume"):
            fakes.train(tmp_path / "run")
    assert not list((tmp_path / "run").rglob(f"{files.TEMPORARY}*"))
    if write > 2:
        assert load(tmp_path / "run").trials == (min(write, 10) - 2) // 2
    fakes.train(tmp_path / "run", resume=True)
    assert contents(tmp_path / "run") == clean


def test_other_configuration_is_refused(fakes, tmp_path):
    fakes.train(tmp_path / "run", stop=lambda: True)
    before = contents(tmp_path / "run")
    with pytest.raises(BnsError, match="trials = 4, not 9"):
        fakes.train(tmp_path / "run", resume=True, config=fakes.longer(9))
    assert contents(tmp_path / "run") == before


def test_finished_run_stays_as_it_is(fakes, clean, tmp_path):
    fakes.train(tmp_path / "clean", resume=True)
    assert contents(tmp_path / "clean") == clean


def test_two_processes_cannot_write_one_run(fakes, tmp_path):
    def again(*_):
        with pytest.raises(BnsError, match="written by another process"):
            fakes.train(tmp_path / "run", resume=True)

    fakes.train(tmp_path / "run", on_trial=again)


@pytest.mark.parametrize("kind", ["three", "ensemble"])
def test_real_learner_in_mujoco_resumes_to_the_same_bytes(tmp_path, kind):
    config = RunConfig(
        evolution=EvolutionConfig(population=12, generations=2),
        snn=SnnConfig(kind=kind, epochs=5, members=2),
        adaptation=AdaptationConfig(window=30, population_reset=True),
        world=WorldConfig(damage=("wheel_gain:wheel=left,factor=0.8@3",)),
        choose="random",
        trials=5,
        replicates=2,
        record_replicates=1,
        compiled="no",
        threads=1,
    )
    train(config, tmp_path / "clean")
    asked = iter([False, False, True])
    train(config, tmp_path / "run", stop=lambda: next(asked))
    train(config, tmp_path / "run", resume=True)
    assert contents(tmp_path / "run") == contents(tmp_path / "clean")
    other = train(replace(config, seed=1), tmp_path / "other")
    assert not np.array_equal(load(tmp_path / "run").sent, other.sent, equal_nan=True)


WORLDS = {"khepera-simple": "mujoco", "hexapod-walk": "hexapod"}


def small(name):
    config = presets.load(name)
    return replace(
        config,
        replicates=1,
        threads=1,
        compiled="no",
        evolve_from=1,
        evolution=replace(
            config.evolution, population=12, tournament=3, generations=10
        ),
        snn=replace(config.snn, hidden=6, epochs=3),
    )


def world(name, task):
    robot = task.config.world.robot
    return registry.make(WORLDS[name], robot=robot, **task.surroundings())


@pytest.mark.parametrize("name", WORLDS)
def test_generations_run_during_a_trial_and_after_it_and_are_counted(name):
    config = small(name)
    told = {"replicates": [0], "onsets": [-1]}
    learner = learners.get("bns")([config], **told)
    learner.run_in_background()
    place = world(name, learner.task)
    for trial in range(2):
        proposal = learner.propose(trial)
        before = learner.population
        while learner.think():
            pass
        assert learner.population is not before
        assert not learner.think()  # no more than configured
        run = learner.task.execute
        tried = run(place, proposal.tried, trial=trial, seeds=[trial])
        row = learner.observe(trial, tried, None)
        assert row["generations"].tolist() == [10 + LEAST]
    again = learners.get("bns")([config], **told)
    again.restore(learner.state())
    kept, wanted = (one.memories[0].buffer.counts for one in (again, learner))
    assert kept.tolist() == wanted.tolist()


@pytest.mark.parametrize("name", ["random", "cma"])
def test_any_learner_can_be_in_a_process_of_its_own(name):
    config = with_learner(small("khepera-simple"), name)
    config = replace(config, replicates=1, threads=1)
    if name == "cma":
        prior = {"prior.world": "mujoco", "prior.evaluations": 12}
        config = config.with_({**prior, "settings.population": 6})
    learner = behind(config)
    place = world("khepera-simple", learner.task)
    for trial in range(2):
        proposal = learner.propose(trial)
        tried = learner.task.execute(place, proposal.tried, trial=trial, seeds=[0])
        row = learner.observe(trial, tried, None)
    assert np.isfinite(row["best_seen"]).all()
    assert ("evaluations" in row) == (name == "cma")
    assert learner.state().keys()


def test_what_a_learner_deploys_is_measured_apart_beside_a_robot_as_well():
    config = replace(small("khepera-simple"), deploy="seen")
    learner = behind(config)
    place = world("khepera-simple", learner.task)
    step, _ = Batch([config], [place], learner=learner).advance(0)
    assert learner.deploys and step.columns["solved_best"].shape == (1,)


def test_a_task_that_closes_a_loop_is_refused():
    with pytest.raises(BnsError, match="cannot be learned in the background"):
        behind(presets.load("khepera-light"))
