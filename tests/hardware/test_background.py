"""Learning beside a robot that moves."""

from dataclasses import replace

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError
from bns.experiment.background import behind
from bns.experiment.batch import Batch
from bns.experiment.loading import with_learner
from bns.learners import registry as learners
from bns.learners.bns.learner import LEAST
from bns.worlds import registry

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
