"""Survivors of a grid inside the SNN, against answers known in advance."""

from dataclasses import replace

import pytest
import torch

from bns import presets
from bns.errors import BnsError
from bns.evolution import selection
from bns.experiment.run import train
from bns.learners import registry
from bns.tasks.base import BOARD
from tests.bns import robots


def test_the_best_of_each_cell_lives_and_then_the_best_of_the_rest():
    cells = torch.tensor([[7, 7, 3, 3, 5, 7]])
    cost = torch.tensor([[4.0, 1.0, 9.0, 8.0, 6.0, 2.0]])
    index = selection.survivors(cells, cost, 4)
    assert index.tolist() == [[1, 4, 3, 5]]  # cells 7, 5, 3 by cost, then the next best
    assert selection.survivors(cells, cost, 2).tolist() == [[1, 4]]


def test_cells_have_their_edges_where_they_belong():
    found = selection.cells(torch.tensor([[[0.0, 0.0], [0.34, 0.0], [1.0, 1.0]]]), 3)
    assert found.tolist() == [[0, 1, 8]]


def hybrid(**changes):
    config = robots.small(**changes)
    grid = replace(config.evolution, cells=3, selection="random", generations=20)
    return replace(config, evolution=grid)


def made(config):
    told = {"replicates": [0, 1], "onsets": [-1, -1]}
    return registry.get("bns")([config] * 2, **told)


def filled(learner) -> int:
    """Cells that the populations of all runs fill."""
    found = learner.problem.behaviours(learner.memories, learner.population)
    cells = selection.cells(found, 3)
    return sum(len(set(row.tolist())) for row in cells)


def test_a_grid_keeps_more_kinds_of_gaits_than_a_population_does():
    counts = []
    for config in (hybrid(evolve_from=0), robots.small(evolve_from=0)):
        learner = made(config)
        before = learner.propose(0)
        assert len(before.tried) == 2
        counts.append(filled(learner))
    assert counts[0] >= 60  # of 2 x 40 places
    assert counts[0] > 1.5 * counts[1]


def test_behaviours_inside_the_snn_are_those_of_the_task():
    learner = made(hybrid())
    tried = learner.propose(0).tried
    trials = robots.Slider().run(tried)
    inside = learner.problem.behaviours(learner.memories, learner._chosen)[:, 0]
    assert inside.double().numpy() == pytest.approx(learner.task.behaviour(trials))


def test_on_wheels_behaviours_are_where_lists_are_predicted_to_end():
    config = presets.load("khepera-simple")
    sizes = {"population": 20, "generations": 5, "cells": 4}
    changes = {f"evolution.{name}": size for name, size in sizes.items()}
    config = config.with_({**changes, "evolve_from": 0, "compiled": "no"})
    learner = made(config)
    learner.propose(0)
    inside = learner.problem.behaviours(learner.memories, learner.population)
    poses = learner.problem.evaluator.poses(learner.theta, learner.population)
    ends = poses[:, :, -1, :2] / torch.tensor(BOARD)
    torch.testing.assert_close(inside, (ends + 1) / 2)
    assert all(len(set(row.tolist())) >= 2 for row in selection.cells(inside, 4))


def test_killed_and_resumed_it_gives_the_same_bytes(tmp_path):
    config = hybrid(trials=6)
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    train(config, whole, world=robots.Slider())
    asked = iter([False] * 3 + [True])
    train(config, cut, world=robots.Slider(), stop=lambda: next(asked))
    train(config, cut, world=robots.Slider(), resume=True)
    assert (whole / "state.npz").read_bytes() == (cut / "state.npz").read_bytes()


def test_it_is_refused_where_there_are_no_behaviours():
    config = robots.small_light()
    config = replace(config, evolution=replace(config.evolution, cells=3))
    with pytest.raises(BnsError, match=r"evolution\.cells is for walking"):
        made(config)


def test_the_preset_is_the_recovering_one_but_for_its_grid():
    ours, theirs = presets.load("hexapod-hybrid"), presets.load("hexapod-recover")
    grid = replace(theirs.evolution, cells=3, selection="random")
    assert replace(theirs, evolution=grid, preset=ours.preset) == ours
