"""Reduced dynamics and learnt maps give what the simulation gives."""

import numpy as np
import pytest

from bns.gap.models import planar_rollout
from bns.gap.models.surrogate import between, reduced
from bns.gap.models.wheeled import WheeledModel
from bns.worlds.effects import registry
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import body_displacements

NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.01"


@pytest.mark.parametrize("effects", [(), ("axle_length:factor=0.9",)])
def test_reduced_dynamics_are_the_simulation(told, effects):
    edits = tuple(registry.parse(text) for text in effects)
    fast = reduced("khepera3", edits, 1 / 0.0205)
    assert fast.good
    trials = MujocoWorld(reality=effects, threads=1).run(told)
    model = WheeledModel(threads=1)
    (quick,) = model.sketch(trials, [edits])
    for made, trial in zip(quick, trials, strict=True):
        error = body_displacements(made) - body_displacements(trial.poses_world)
        assert np.abs(error[:, :2]).max() < 2e-4
        assert np.abs(error[:, 2]).max() < 3e-3


def test_dynamics_that_do_not_fit_are_simulated(told):
    drag = registry.parse("floor_friction:factor=0.03")
    assert not reduced("khepera3", (drag,), 1 / 0.0205).good


@pytest.mark.parametrize(
    "text",
    [
        "wheel_diameter:wheel=left,factor=1.013",
        "rolling_drag:wheel=left,torque=0.0001",
        "torque_limit:wheel=both,factor=0.2",
    ],
)
def test_maps_between_levels_are_as_those_learnt_there(text):
    effect = registry.parse(text)
    found = between("khepera3", effect, 1 / 0.0205)
    learnt = reduced("khepera3", (effect,), 1 / 0.0205)
    told = np.random.default_rng(0).uniform(-0.1, 0.1, (8, 2)).repeat(100, axis=0)
    made = planar_rollout.poses(
        [found.map, learnt.map], [planar_rollout.halved(told)] * 2, [None] * 2
    )
    apart = body_displacements(made[0]) - body_displacements(made[1])
    assert np.abs(apart).max() < 4e-4
    assert found.good


def test_a_sloping_floor_is_as_simulated(told):
    slope = registry.parse("floor_slope:angle=0.03,direction=1")
    trials = MujocoWorld(reality=[slope], threads=1).run(told[:1])
    ((quick,),) = WheeledModel(threads=1).sketch(trials, [[slope]])
    error = body_displacements(quick) - body_displacements(trials[0].poses_world)
    assert np.abs(error).max() < 1e-3
    assert np.abs(quick[-1, :2] - trials[0].poses_world[-1, :2]).max() < 0.01
