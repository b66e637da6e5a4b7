"""Recordings of walking: the leg is found before a fit, a planted effect is named."""

import numpy as np
import pytest

from bns.gap.bench import cases, walk_cases
from bns.gap.bench.walk_cases import WalkStand
from bns.gap.candidates import legged
from bns.gap.decomposition import descent, diagnosis, fit, levels
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.refit import newton
from bns.gap.diagnose import diagnose
from bns.gap.models.legged import scatter, signs
from bns.gap.models.legged.model import READING, WalkModel
from bns.gap.models.legged.signs import Signs, Suspects
from bns.gap.recordings import check
from bns.models.legs import LEGS
from bns.worlds.active import Stages
from bns.worlds.damage import Damage
from bns.worlds.effects import registry
from bns.worlds.physics import legged_plan
from bns.worlds.trial import Commands
from tests.sources import ROOT

KEPT = ("servo_gain[right_front]", "servo_delay[right_front]", "payload")


@pytest.fixture(scope="module")
def model():
    return WalkModel()


@pytest.fixture(scope="module")
def told(model):
    return walk_cases.commands(np.random.default_rng(2), model)


def test_what_was_recorded_is_executed_again(model, told):
    trials = walk_cases.record(told, [], 1)
    (predicted,) = model.simulate(trials, [()])
    for trial, made in zip(trials, predicted, strict=True):
        assert np.abs(made[:, 3:] - trial.observed[:, 3:]).max() < 2 * READING
        assert np.abs(made[:, :2] - trial.observed[:, :2]).max() < 6e-3


def test_commands_can_be_given_their_steps(model, told):
    stages = Stages.of(Damage.none(), Damage.none(), 0, 9.0)
    given = {"start": (0.0, 0.0, 0.0), "speed": 3.0, "seed": 0, "trial": 0}
    job, _ = legged_plan.job(
        "phantomx", told[0], stages, counts=np.array([40, 50]), **given
    )
    assert [len(piece.control) for piece in job.pieces] == [40, 50]
    assert [piece.limit for piece in job.pieces] == [40, 50]


def test_the_leg_is_found_before_anything_is_fitted(model, told):
    weak = registry.make("servo_gain", servo="right_front", factor=0.5)
    trials = walk_cases.record(told, [weak], 1)
    (predicted,) = model.simulate(trials, [()])
    rests = [
        t.observed[:, 3:] - p[:, 3:] for t, p in zip(trials, predicted, strict=True)
    ]
    found = signs.suspects(rests, model.joints, READING)
    assert found.legs == ("right_front",)
    share = signs.shares(rests, model.joints, READING)
    assert sum(share.values()) == pytest.approx(1.0)


def test_one_leg_alone_leaves_out_effects_on_all():
    names = ("left_front_coxa", "right_front_coxa")
    rests = [np.column_stack([np.full(50, 0.1), np.zeros(50)])]
    found = signs.suspects(rests, names, READING)
    assert found == Suspects(("left_front_coxa",), ("left_front",), False)
    listed = [row.name for row in legged.rows(found)]
    assert "servo_delay[all]" not in listed
    assert "servo_gain[all]" in listed  # as what the model is uncertain of
    assert "servo_delay[left_front_coxa]" in listed


def test_candidates_are_on_legs_that_the_robot_has():
    model = WalkModel(str(ROOT / "examples" / "quad"))
    rests = [np.full((50, len(model.joints)), 0.1)]
    found = signs.suspects(rests, model.joints, READING)
    names = [row.name for row in legged.rows(found, model.joints)]
    assert "foot_slippery[right_rear]" in names and "link_length[tibia,all]" in names
    assert not any("middle" in name for name in (*names, *found.legs))


def test_what_walking_scatters_is_found_by_walking(model, told):
    """A robot that is a little off, as it may be, leaves hardly more than the noise."""
    trials = walk_cases.record(
        told, walk_cases.imperfection(np.random.default_rng(4)), 1
    )
    problem = Problem.of(trials, model)
    walks = [k for k, row in enumerate(problem.rows) if row.nuisance]
    assert len(walks) == scatter.WALKS
    rest, _ = problem.residual(problem.nominal)
    slopes = problem.slopes(problem.nominal, walks)
    design = np.stack([slopes[k].ravel() for k in walks], axis=1) / model.least.mean()
    scale = np.tile(model.least, len(rest))
    columns = design * model.least.mean() / scale[:, None] / np.sqrt(scatter.WALKS)
    units = rest.ravel() / scale
    found = np.linalg.solve(columns.T @ columns + np.eye(len(walks)), columns.T @ units)
    assert (units**2).mean() > 2.0
    assert ((units - columns @ found) ** 2).mean() < 0.6 * (units**2).mean()


def test_what_walking_scatters_is_otherwise_beside_what_was_found(model, told):
    trials = walk_cases.record(told[:1], [], 1)
    share = {row.name: 1.0 for row in model.rows(trials) if row.nuisance}
    one = dict(list(share.items())[:1])
    late = {"command_latency": 0.06}
    other, begun = model.beside(trials, [late | one] * len(trials))
    assert begun is trials and other is not model
    changed = []
    for some in (model, other):
        bare, shared = some.paths(trials, [[late], [late | one]])
        changed.append(shared[0] - bare[0])
    assert np.abs(changed[1]).max() > 1e-3
    assert np.abs(changed[1] - changed[0]).max() > 1e-3


def test_walks_of_unequal_length_are_compared(model):
    """Commands last until the robot rests: no two trials are as long."""
    told = walk_cases.commands(np.random.default_rng(2), model)
    told[1] = Commands(told[1].values[:1], told[1].durations[:1], told[1].channels)
    trials = walk_cases.record(told, [registry.parse("leg_raised:legs=1,blend=1")], 1)
    problem = Problem.of(trials, model)
    assert len(problem.windows[0]) != len(problem.windows[1])
    rest, _ = newton(
        problem,
        problem.nominal.copy(),
        fit.nuisances(problem),
        fit.first_noise(problem, *problem.residual(problem.nominal)),
        turns=1,
    )
    assert np.isfinite(rest).all()


def test_two_legs_that_depart_alike_are_both_suspected():
    names = ("left_front_coxa", "right_front_coxa", "left_rear_coxa")
    rests = [np.column_stack([np.full(50, v) for v in (0.1, 0.09, 0.01)])]
    found = signs.suspects(rests, names, READING)
    assert found.legs == ("left_front", "right_front")


def test_a_planted_effect_is_named_with_its_leg(model, told):
    weak = registry.make("servo_gain", servo="right_front", factor=0.5)
    trials = walk_cases.record(told, [weak], 1)
    made = diagnose(trials, model, rows=KEPT, full=False)
    assert made.verdict.named == (("servo_gain[right_front]",),)
    assert made.best.magnitudes[0] == pytest.approx(0.5, abs=0.03)


def test_a_soft_floor_is_named_which_a_tangent_misses(model, told):
    """Feet come down elsewhere: by the slope at the nominal it explains nothing."""
    soft = registry.make("floor_compliance", factor=3.0)
    trials = walk_cases.record(told, [soft], 1)
    usable, _ = check.check(trials, model)
    names = (*KEPT, "floor_compliance", "foot_slippery[all]", "centre_of_mass.dx")
    problem = diagnosis.narrowed(Problem.of(usable, model), names)
    start = descent.nothing(problem)
    first, values = levels.screened(problem, start, 3)[0]
    assert first == "floor_compliance"
    assert newton(problem, values, {first}, start.noise)[0][
        problem.terms[first][0]
    ] == pytest.approx(3.0, abs=0.3)


def test_cases_hide_an_effect_and_say_which(model):
    case, again = (cases.build(3, "lost", WalkStand(model)) for _ in range(2))
    assert case.answer == again.answer
    assert len(case.answer.names) == 1 and case.answer.magnitudes[0] == 1.0
    assert all(
        np.array_equal(a.observed, b.observed)
        for a, b in zip(case.trials, again.trials, strict=True)
    )


LOST = {  # joints that show it, and what it is called
    "leg_raised:legs=3,blend=1": (3, "leg_raised[left_rear]"),
    "leg_limp:legs=3,loss=1": (3, "leg_limp[left_rear]"),
    "leg_missing:legs=3,loss=1": (3, "leg_missing[left_rear]"),
    "joint_locked:joint=left_rear_femur,loss=1,angle=0.3": (
        1,
        "joint_locked[left_rear_femur]",
    ),
}


@pytest.mark.parametrize("damage", LOST)
def test_legs_and_joints_that_are_lost_are_named(model, told, damage):
    number, named = LOST[damage]
    trials = walk_cases.record(told, [registry.parse(damage)], 1)
    joints = _signs(model, trials).joints
    assert len(joints) == number and all("left_rear" in joint for joint in joints)
    usable, notes = check.check(trials, model)
    own = [note for note in notes if "left_rear" in note]
    assert not any("dropped" in note for note in own)  # nothing is stuck
    wanted = (named, "joint_locked[left_rear_femur]", "servo_gain[left_rear_femur]")
    assert usable
    made = diagnose(trials, model, rows=wanted, full=False)
    assert made.verdict.named == ((named,),)
    assert made.best.magnitudes[0] == pytest.approx(1.0, abs=0.02)


def test_play_in_a_horn_is_named_with_its_joint(model, told):
    loose = registry.make("loose_horn", joint="left_front_femur", angle=0.3)
    trials = walk_cases.record(told, [loose], 1)
    others = ("loose_horn[left_front_tibia]", "servo_offset[left_front_femur]")
    wanted = ("loose_horn[left_front_femur]", *others)
    made = diagnose(trials, model, rows=wanted, full=False)
    assert made.verdict.named == ((wanted[0],),)
    assert made.best.magnitudes[0] == pytest.approx(0.3, abs=0.03)


def test_joints_that_follow_or_are_told_nothing_else_show_no_sign(model, told):
    assert not _signs(model, walk_cases.record(told, [], 1)).joints
    still = [Commands(np.zeros((2, 18)), [0.5, 0.5], told[0].channels)]
    assert not _signs(model, walk_cases.record(still, [], 1)).joints


def _signs(model, trials):
    (predicted,) = model.simulate(trials, [()])
    return model.signs(trials, predicted)


def test_blind_cases_are_made_of_walkers_of_ones_own():
    quad = WalkModel(str(ROOT / "examples" / "quad"))
    plain = cases.build(1, "none", WalkStand(quad))
    assert plain.answer.names == () and len(plain.answer.nominal) == 4
    assert len(plain.trials[0].channels) == 3 + len(quad.joints)
    case = cases.build(3, "lost", WalkStand(quad))
    assert "middle" not in case.answer.names[0]
    assert not any(trial.outcome.fell for trial in case.trials)


def test_nothing_is_lost_where_no_loss_explains_much(model, told):
    trials = walk_cases.record(told, [], 1)
    every = legged.lost(Signs({}, (), LEGS, LEGS))
    assert scatter.likely(trials, every, model.simulate) == ()
    assert scatter.likely(trials, (), model.simulate) == ()


def test_two_legs_are_lost_one_after_the_other(model, told):
    limp = registry.make("leg_limp", legs="1,5", loss=1.0)
    trials = walk_cases.record(told, [limp], 1)
    every = legged.lost(Signs({}, (), LEGS, ()))
    found = scatter.likely(trials, every, model.simulate)
    assert {effect["legs"] for effect in found} == {"1", "5"}
