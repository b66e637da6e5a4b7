"""Recordings of walking: the leg is found before a fit, a planted effect is named."""

import numpy as np
import pytest

from bns.gap import check, diagnose, walk_cases, walk_library, walk_where
from bns.gap.problem import Problem
from bns.gap.walk_model import READING, WalkModel
from bns.gap.walk_where import Suspects
from bns.worlds import legged_plan
from bns.worlds.active import Stages
from bns.worlds.damage import Damage
from bns.worlds.effects import registry
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
    found = walk_where.suspects(rests, model.joints, READING)
    assert found.legs == ("right_front",)
    share = walk_where.shares(rests, model.joints, READING)
    assert sum(share.values()) == pytest.approx(1.0)


def test_one_leg_alone_leaves_out_effects_on_all():
    names = ("left_front_coxa", "right_front_coxa")
    rests = [np.column_stack([np.full(50, 0.1), np.zeros(50)])]
    found = walk_where.suspects(rests, names, READING)
    assert found == Suspects(("left_front_coxa",), ("left_front",), False)
    listed = [item.name for item in walk_library.candidates(found)]
    assert "servo_delay[all]" not in listed
    assert "servo_gain[all]" in listed  # as what the model is uncertain of
    assert "servo_delay[left_front_coxa]" in listed


def test_candidates_are_on_legs_that_the_robot_has():
    model = WalkModel(str(ROOT / "examples" / "quad"))
    rests = [np.full((50, len(model.joints)), 0.1)]
    found = walk_where.suspects(rests, model.joints, READING)
    names = [item.name for item in walk_library.candidates(found, model.joints)]
    assert "foot_slippery[right_rear]" in names and "link_length[tibia,all]" in names
    assert not any("middle" in name for name in (*names, *found.legs))


def test_what_walking_scatters_is_found_by_walking(model, told):
    """A robot that is a little off, as it may be, leaves hardly more than the noise."""
    trials = walk_cases.record(
        told, walk_cases.imperfection(np.random.default_rng(4)), 1
    )
    kept = [item for item in model.candidates() if item.slack > 0]
    plain = Problem.of(trials, model)
    known = Problem.of(trials, model, candidates=kept)
    assert (plain.rest**2).mean() > 2.0
    assert (known.rest**2).mean() < 1.2
    heavy = known.signatures([[registry.make("payload", mass=1.0)]])
    assert np.linalg.norm(heavy) > 20


def test_two_legs_that_depart_alike_are_both_suspected():
    names = ("left_front_coxa", "right_front_coxa", "left_rear_coxa")
    rests = [np.column_stack([np.full(50, v) for v in (0.1, 0.09, 0.01)])]
    found = walk_where.suspects(rests, names, READING)
    assert found.legs == ("left_front", "right_front")


def test_a_planted_effect_is_named_with_its_leg(model, told):
    weak = registry.make("servo_gain", servo="right_front", factor=0.5)
    trials = walk_cases.record(told, [weak], 1)
    kept = [item for item in model.suspected(trials) if item.name in KEPT]
    made = diagnose.analyse(trials, model, candidates=kept, most=1)
    assert made.verdict.named == (("servo_gain[right_front]",),)
    assert made.choice.best.terms[0].magnitude == pytest.approx(0.5, abs=0.03)


def test_cases_hide_an_effect_and_say_which(model):
    case = walk_cases.build(3, "single", model)
    again = walk_cases.build(3, "single", model)
    assert case.term == again.term
    assert case.term is not None
    assert all(
        np.array_equal(a.observed, b.observed)
        for a, b in zip(case.trials, again.trials, strict=True)
    )


@pytest.mark.parametrize(
    "damage, held, named",
    [
        ("leg_raised:legs=3,blend=1", 3, "leg_raised[left_rear]"),
        (
            "joint_locked:joint=left_rear_femur,loss=1,angle=0.3",
            1,
            "joint_locked[left_rear_femur]",
        ),
    ],
)
def test_what_holds_still_whatever_it_is_told_is_named(
    model, told, damage, held, named
):
    trials = walk_cases.record(told, [registry.parse(damage)], 1)
    found = model.held(trials)
    assert len(found) == held and all("left_rear" in joint for joint in found)
    usable, notes = check.check(trials, model)
    assert not any("samples dropped" in note for note in notes)  # nothing is stuck
    wanted = (named, "joint_locked[left_rear_femur]", "servo_gain[left_rear_femur]")
    kept = [item for item in model.suspected(usable) if item.name in wanted]
    made = diagnose.analyse(trials, model, candidates=kept, most=1)
    assert made.verdict.named == ((named,),)
    assert made.choice.best.terms[0].magnitude == pytest.approx(1.0, abs=0.02)


def test_joints_that_follow_or_are_told_nothing_else_are_not_held(model, told):
    assert model.held(walk_cases.record(told, [], 1)) == {}
    still = [Commands(np.zeros((2, 18)), [0.5, 0.5], told[0].channels)]
    assert model.held(walk_cases.record(still, [], 1)) == {}
