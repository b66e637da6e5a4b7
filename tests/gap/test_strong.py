"""Effects that look alike at one speed are told apart by others."""

import numpy as np

from bns.gap.decomposition import descent
from bns.gap.decomposition.problem import Problem
from bns.gap.diagnose import diagnose
from bns.gap.models.wheeled.model import WheeledModel
from bns.gap.planning import excitation
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import Commands

NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.008"
DRAG = "rolling_drag:wheel=both,torque=1e-4,viscous=0"
NAMES = "rolling_drag.torque[both]", "rolling_drag.viscous[both]"


def test_dry_friction_is_told_from_viscous():
    model = WheeledModel("khepera3", threads=1)
    family = {item.name: item.commands for item in excitation.wheeled()}
    slow = family["medium turn in place, both ways, each for 5 s"]
    fast = family["fast turn in place, both ways, each for 1.5 s"]
    world = MujocoWorld("khepera3", reality=[DRAG, NOISE], threads=1)
    trials = world.run([slow] * 2 + [fast] * 5, seeds=range(7))
    found = diagnose(trials, model, rows=NAMES, full=False)
    assert found.verdict.named == (("rolling_drag.torque[both]",),)
    assert abs(found.best.magnitudes[0] - 1e-4) < 1e-5


def test_a_wheel_that_sticks_is_told_from_a_dead_band():
    model = WheeledModel("khepera3", threads=1)
    sticks = "rolling_drag:wheel=right,torque=0.002,breakaway=0.004"
    speeds = [0.05, 0.09, 0.14, 0.2]
    told = [[[v, v], [0.0, 0.0], [-v, -v]] for v in speeds]
    world = MujocoWorld("khepera3", reality=[sticks, NOISE], threads=1)
    trials = world.run([Commands(np.array(row), np.full(3, 1.2)) for row in told * 2])
    names = [f"{name}[right]" for name in ("rolling_drag.torque", "dead_band")]
    found = diagnose(trials, model, rows=names, full=False)
    assert found.verdict.named == (("rolling_drag.torque[right]",),)
    assert abs(found.best.magnitudes[0] - 0.002) < 1e-4
    assert ", breakaway 0.0" in found.verdict.sentence


def test_a_floor_that_is_slippery_carries_nothing():
    model = WheeledModel("khepera3", threads=1)
    slips = "floor_friction:factor=0.05"
    told = [[[v, v], [-v, v], [0.0, 0.0], [-v, -v]] for v in (0.1, 0.2, 0.29)]
    world = MujocoWorld("khepera3", reality=[slips, NOISE], threads=1)
    trials = world.run([Commands(np.array(row), np.full(4, 1.0)) for row in told * 2])
    names = ["floor_friction", "payload", "motor_lag[both]", "dead_zone[right]"]
    found = diagnose(trials, model, rows=names, full=False)
    assert found.verdict.named == (("floor_friction",),)
    assert abs(found.best.magnitudes[0] - 0.05) < 5e-3


def test_a_limit_that_came_back_to_the_nominal_explains_nothing():
    model = WheeledModel("khepera3", threads=1)
    told = Commands(np.array([[0.1, 0.1], [0.05, 0.15]]), np.array([1.0, 1.0]))
    trials = MujocoWorld("khepera3", reality=[NOISE], threads=1).run([told] * 3)
    names = ["wheel_gain[left]", "speed_saturation[right]"]
    problem = Problem.of(trials, model)
    point = descent.fitted_at(problem, descent.nothing(problem), names)
    assert point.support == {"wheel_gain[left]"}
    assert np.isfinite(point.cost)
