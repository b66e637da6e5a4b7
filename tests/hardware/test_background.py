"""Evolution beside a robot that moves."""

from dataclasses import replace

import pytest

from bns import presets
from bns.errors import BnsError
from bns.experiment.background import LEAST, Worker, behind
from bns.learners import registry as learners
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


@pytest.mark.parametrize("name", WORLDS)
def test_generations_run_during_a_trial_and_after_it_and_are_counted(name):
    config = small(name)
    worker = Worker([config], replicates=[0], onsets=[-1])
    kind = learners.get(config.learner)
    world = registry.make(
        WORLDS[name], robot=config.world.robot, **kind.surroundings(config)
    )
    for trial in range(2):
        proposal = worker.propose(trial)
        assert worker.busy
        before = worker.learner.population
        while worker.busy:
            worker.breed()
        assert worker.generations == 10  # no more than configured
        assert worker.learner.population is not before
        tried = kind.execute(world, proposal.tried, trial=trial, seeds=[trial])
        row = worker.observe(trial, tried, None)
        assert row["generations"].tolist() == [10 + LEAST] and not worker.busy
    kept = worker.state()
    again = Worker([config], replicates=[0], onsets=[-1])
    again.restore(kept)
    assert again.learner.buffer.counts.tolist() == worker.learner.buffer.counts.tolist()


def test_a_learner_that_closes_a_loop_is_refused():
    with pytest.raises(BnsError, match="cannot go on in the background"):
        behind(presets.load("khepera-light"))
