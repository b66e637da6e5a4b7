"""Levels of what has no slope, and what ties with them, on recordings of a robot."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.bench.wheeled_cases import commands
from bns.gap.decomposition import descent, diagnosis, levels, refit, simpler
from bns.gap.decomposition.levels import Level
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row
from bns.gap.diagnose import diagnose
from bns.gap.recordings import check
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import Commands

NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.01"
STUCK = ("wheel_stuck_max[right]", "wheel_stuck_min[right]", "wheel_gain[right]")


def driven(effect):
    told = [
        Commands(item.values[:4], item.durations[:4])
        for item in commands(np.random.default_rng(5), 8)
    ]
    effects = [effect, NOISE]
    return MujocoWorld(reality=effects, threads=1).run(told, seeds=range(8))


def test_a_wheel_that_is_stuck_by_a_little_is_named(model):
    trials = driven("wheel_stuck_min:wheel=right,direction=backward,blend=0.1")
    found = diagnose(trials, model, rows=STUCK, full=False)
    assert found.verdict.named == (("wheel_stuck_min[right]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.1, abs=0.02)


def test_one_level_stands_for_another_and_what_undoes_it(model):
    trials = driven("wheel_stuck_min:wheel=right,direction=backward,blend=0.1")
    trials, _ = check.check(trials, model)
    problem = diagnosis.narrowed(Problem.of(trials, model), STUCK)
    start = descent.nothing(problem)
    values = problem.nominal.copy()
    names = [row.name for row in problem.rows]
    values[names.index("wheel_stuck_max[right]@backward")] = 0.05
    values[names.index("wheel_gain[right]")] = 0.95
    both = {"wheel_stuck_max[right]", "wheel_gain[right]"}
    point = refit.fitted_at(problem, replace(start, values=values), both)
    assert point.support == both
    assert simpler.united(problem, point).support == {"wheel_stuck_min[right]"}


def test_a_load_ties_with_the_centre_of_mass_that_it_shifts(model):
    trials = driven("centre_of_mass:dx=0,dy=0.012")
    names = ("centre_of_mass.dy", "payload", "wheel_gain[left]", "axle_length")
    found = diagnose(trials, model, rows=names, full=False)
    assert found.verdict.named == (("centre_of_mass.dy",), ("payload",))


def test_a_level_is_the_one_that_leaves_least_beside_its_own_set():
    """What was found before it may have made another one look better."""
    row = Row("limit", 1.0, 0.3, 0.0, 1.0, smooth=False, levels=(0.2, 0.3, 0.4))
    recorded = np.array([[0.3], [0.6]])
    problem = SimpleNamespace(
        terms={"limit": (0,)},
        rows=(row,),
        seen=np.isfinite(recorded),
        nominal=np.array([1.0]),
        predict=lambda sets, fine, only: [
            v[0] * np.array([[1.0], [2.0]]) for v in sets
        ],
    )
    point = SimpleNamespace(
        values=np.array([1.0]),
        rest=recorded - np.array([[1.0], [2.0]]),
        noise=SimpleNamespace(loss=lambda rest: float((rest**2).sum()), lam=1.0),
    )
    level = Level("limit", 5.0, np.array([0.4]), frozenset({"limit"}))
    assert levels._nearest(problem, point, level).values == pytest.approx([0.3])


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_a_dragging_caster_is_named_whatever_the_law_of_its_friction(model, cone):
    trials = driven(f"caster_drag:friction=0.2,cone={cone}")
    names = ("caster_drag", "payload", "wheel_diameter[both]", "dead_zone[both]")
    found = diagnose(trials, model, rows=names, full=False)
    assert found.verdict.named == (("caster_drag",),)
    assert found.best.magnitudes[0] == pytest.approx(0.2, rel=0.03)
    assert f"cone={cone}" in found.best.effects[0]


@pytest.mark.parametrize("cone", ["elliptic", "model"])
def test_a_slippery_floor_is_no_weak_motor(model, cone):
    trials = driven(f"floor_friction:factor=0.06,cone={cone}")
    names = ("floor_friction", "torque_limit[both]", "wheel_diameter[left]")
    found = diagnose(trials, model, rows=names, full=False)
    assert found.verdict.named == (("floor_friction",),)
    assert found.best.magnitudes[0] == pytest.approx(0.06, rel=0.05)
    assert ("cone=elliptic" in found.best.effects[0]) == (cone == "elliptic")


def test_a_wheel_that_is_slow_backwards_is_no_stuck_one(model):
    trials = driven("reverse_gain:wheel=both,factor=0.9")
    names = (*STUCK, "reverse_gain[both]", "reverse_gain[left]", "reverse_gain[right]")
    found = diagnose(trials, model, rows=names, full=False)
    assert found.verdict.named == (("reverse_gain[both]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.9, abs=0.01)
