"""PETS: an ensemble's own paths, and a search that goes on from trial to trial."""

from dataclasses import replace

import numpy as np
import torch

from bns import presets
from bns.experiment.batch import Batch
from bns.experiment.loading import with_learner
from bns.learners.bns.navigation import Evaluator
from bns.learners.pets import Particles, Pets
from bns.worlds import registry as worlds


def config(preset="khepera-simple", **told):
    base = replace(presets.load(preset), trials=8, replicates=2, threads=1)
    search = {"population": 60, "iterations": 10, "elites": 10}
    own = {f"settings.{name}": value for name, value in search.items()}
    cut = {"compiled": "no", "snn.epochs": 60, "world.damage": []}
    return with_learner(base, "pets").with_({**cut, **own, **told})


def made(**told):
    return Pets([config(**told)] * 2, replicates=[0, 1], onsets=[-1, -1])


def test_a_list_costs_what_the_paths_of_all_networks_cost_on_average():
    learner = made()
    problem, theta = learner.problem, learner.theta
    together = problem.evaluator
    assert isinstance(together, Particles) and problem.shape.groups == 5
    lists = problem.encoding.random(2, 7, learner.draws)
    alone = Evaluator(**(vars(together) | {"shape": replace(together.shape, groups=1)}))
    first, bias, second, last = (
        part.reshape(2, 5, -1) for part in together.shape.split(theta)
    )
    costs = [
        alone.cost(
            torch.cat([first[:, i], bias[:, i], second[:, i], last[:, i]], dim=1), lists
        )
        for i in range(5)
    ]
    torch.testing.assert_close(
        together.cost(theta, lists), torch.stack(costs).mean(0), rtol=1e-4, atol=0.1
    )


def test_networks_are_an_ensemble_without_dropout_whatever_is_said():
    learner = made(**{"snn.kind": "three", "snn.dropout": 0.5})
    assert learner.config.snn.kind == "ensemble" and learner.config.snn.dropout == 0
    assert learner.config.snn.hidden == presets.load("khepera-simple").snn.hidden


def test_the_search_goes_on_and_the_cost_inside_the_ensemble_falls():
    world = worlds.make("static-snn", robot="khepera3")
    batch = Batch([config()], [world])
    learner, errors = batch.learner, []
    for trial in range(8):
        step, _ = batch.advance(trial)
        errors.append(step.columns["snn_turn"])
    assert np.median(errors[-1]) < 0.5 * np.median(errors[1])
    before = learner.problem.cost(learner.memories, learner.population).min(1).values
    learner.propose(8)
    assert (learner.cost[:, 0] <= before).all()
    assert (learner.cost[:, 0] < before).any()
    assert learner.population.lengths.shape == (2, 10)


def test_a_told_damage_resets_what_the_preset_says_as_in_bns():
    told = [config(**{"adaptation.population_reset": True}), config()]
    learner = Pets(told, replicates=[0, 1], onsets=[2, 2])
    world = worlds.make("static-snn", robot="khepera3")
    for trial in range(3):
        tried = learner.propose(trial).tried
        trials = learner.task.execute(world, tried, trial=trial, seeds=[0, 1])
        learner.observe(trial, trials, None)
    elites = learner.population.genes.clone()
    learner._reset(3)
    assert not torch.equal(learner.population.genes[0], elites[0])
    assert torch.equal(learner.population.genes[1], elites[1])
