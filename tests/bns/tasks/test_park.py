"""Parking against answers known beforehand."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from bns import presets
from bns.experiment.loading import with_learner
from bns.experiment.run import train
from bns.tasks import registry as tasks
from bns.tasks.park import TURN_COST, Bay, ParkTask
from bns.worlds import registry
from bns.worlds.trial import Commands, Trial

CONFIG = presets.load("khepera-simple").with_({"task.name": "park"})


def ended(x, y, degrees):
    poses = np.array([[0.0, 0.0, 0.0], [x, y, math.radians(degrees)]])
    return Trial(Commands([[0.1, 0.1]], [1.0]), [0.0, 1.0], poses, [0, 1])


@pytest.mark.parametrize(
    ("pose", "solved", "reached", "cost"),
    [
        ((0.3, 0.3, 180), 1, 1, 5.0),
        ((0.3, 0.3, -180), 1, 1, 5.0),  # the same way
        ((0.3, 0.3, 540), 1, 1, 5.0),  # once round
        ((0.38, 0.3, 180), 1, 1, 13.0),
        ((0.40, 0.3, 180), 0, 0, 15.0),
        ((0.3, 0.3, 90), 0, 1, 5.0 + TURN_COST * math.pi / 2),
    ],
)
def test_cost_and_what_counts_as_parked(pose, solved, reached, cost):
    row = ParkTask(CONFIG).measured([ended(*pose)])
    assert (row["solved"][0], row["reached"][0]) == (solved, reached)
    assert row["fitness"][0] == pytest.approx(cost, abs=1e-3)


def test_an_end_that_was_lost_is_where_it_was_seen_last():
    trial = ended(0.3, 0.3, 180)
    lost = trial.replace(
        commands=Commands([[0.1, 0.1]] * 2, [1.0] * 2),
        times=np.arange(3.0),
        observed=np.vstack([trial.observed, np.full(3, np.nan)]),
        boundaries=np.arange(3),
        handled=np.zeros(2, bool),
    )
    assert ParkTask(CONFIG).fitness([lost])[0] == pytest.approx(10.0, abs=1e-3)


def test_the_network_s_paths_are_judged_by_the_same_rule():
    bay = tasks.of(CONFIG).path_goal()
    assert isinstance(bay, Bay)
    yaw, lengths = torch.full((2, 2), math.pi), torch.tensor([1, 2])
    x = torch.tensor([[0.1, 0.2], [0.3, 0.4]])
    y = torch.tensor([[0.0, 0.1], [0.3, 0.3]])
    assert bay.judge(x, y, yaw, lengths).tolist() == pytest.approx(
        [5.0, 20.0], abs=1e-3
    )


@pytest.mark.parametrize("learner", ["bns", "random"])
def test_a_learner_that_knows_nothing_of_it_learns_it(learner):
    config = CONFIG if learner == "bns" else with_learner(CONFIG, learner)
    if learner == "bns":
        config = config.with_(
            {
                "evolution.generations": 40,
                "evolution.population": 60,
                "snn.epochs": 150,
                "compiled": "no",
            }
        )
    config = replace(config, trials=12, replicates=4, record_replicates=0, threads=1)
    world = registry.make("static-snn", robot="khepera3")
    record = train(config, world=world)
    first, last = record["fitness"][:, 0], record["fitness_best"][:, -4:].min(1)
    assert (last < first).all()
    if learner == "bns":
        assert np.median(last) < 0.5 * np.median(first)
