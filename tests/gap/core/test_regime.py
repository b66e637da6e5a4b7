"""What went on in a window does not hold the noise of its samples."""

import numpy as np
from scipy.stats import chi2

from bns.gap.core import null, segments
from bns.gap.core.floor import Floor
from bns.gap.core.problem import Problem
from bns.gap.models.wheeled import WheeledModel
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import Commands

NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.008"


def test_a_robot_that_stays_has_no_places():
    noise = np.random.default_rng(0).normal(0, 1e-3, (50, 3))
    coarse = segments.coarse(noise + np.array([0.4, -0.2, 3.1]))
    assert np.ptp(coarse, axis=0).max() < 1e-12
    along = np.linspace(0, 1, 50)[:, None] * [0.5, 0.0, 0.0]
    assert len(np.unique(segments.coarse(along)[:, 0].round(9))) == 17  # 0.5 m / 3 cm


def test_noise_alone_has_no_structure():
    model = WheeledModel("khepera3", threads=1)
    turn = np.array([[-0.07, 0.07], [0.07, -0.07]] * 12)
    told = [Commands(turn, np.full(len(turn), 0.4))] * 3
    world = MujocoWorld("khepera3", reality=[NOISE], threads=1)
    floor = Floor(np.array([1e-3, 1e-3, 8e-3]), 1e-3 * model.process, "known", 1)
    found = []
    for seed in range(5):
        trials = world.run(told, seeds=[10 * seed + n for n in range(3)])
        problem = Problem.of(trials, model, floor=floor)
        basis = null.flexible(problem)
        explained = float(((problem.rest @ basis) ** 2).sum())
        found.append(chi2.sf(explained, basis.shape[1]))
    assert min(found) > 0.01, found
