"""Recordings of walking: the leg is found before a fit, a planted effect is named."""

import numpy as np
import pytest

from bns.gap import diagnose
from bns.gap.bench import walk_bench, walk_cases
from bns.gap.candidates import legged
from bns.gap.core import uncertainty
from bns.gap.core.problem import Problem
from bns.gap.models.legged import lost, where
from bns.gap.models.legged.model import READING, WalkModel
from bns.gap.models.legged.signs import Signs
from bns.gap.models.legged.where import Suspects
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
    found = where.suspects(rests, model.joints, READING)
    assert found.legs == ("right_front",)
    share = where.shares(rests, model.joints, READING)
    assert sum(share.values()) == pytest.approx(1.0)


def test_one_leg_alone_leaves_out_effects_on_all():
    names = ("left_front_coxa", "right_front_coxa")
    rests = [np.column_stack([np.full(50, 0.1), np.zeros(50)])]
    found = where.suspects(rests, names, READING)
    assert found == Suspects(("left_front_coxa",), ("left_front",), False)
    listed = [item.name for item in legged.candidates(found)]
    assert "servo_delay[all]" not in listed
    assert "servo_gain[all]" in listed  # as what the model is uncertain of
    assert "servo_delay[left_front_coxa]" in listed


def test_candidates_are_on_legs_that_the_robot_has():
    model = WalkModel(str(ROOT / "examples" / "quad"))
    rests = [np.full((50, len(model.joints)), 0.1)]
    found = where.suspects(rests, model.joints, READING)
    names = [item.name for item in legged.candidates(found, model.joints)]
    assert "foot_slippery[right_rear]" in names and "link_length[tibia,all]" in names
    assert not any("middle" in name for name in (*names, *found.legs))


def test_legs_that_were_not_suspected_are_tried_before_giving_up(
    model, told, monkeypatch
):
    weak = registry.make("servo_gain", servo="right_front", factor=0.5)
    trials, asked = walk_cases.record(told, [weak], 1), []

    def suspected(found, *, everywhere=False):
        asked.append(everywhere)
        wanted = "servo_gain[right_front]" if everywhere else "payload"
        every = WalkModel.suspected(model, found, everywhere=True)
        return [item for item in every if item.name == wanted]

    monkeypatch.setattr(model, "suspected", suspected)
    made = diagnose.analyse(trials, model, most=1)
    assert made.verdict.named == (("servo_gain[right_front]",),)
    assert asked == [False, True]
    assert made.clock.seconds["fits"] > 0


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
    found = where.suspects(rests, names, READING)
    assert found.legs == ("left_front", "right_front")


def test_a_planted_effect_is_named_with_its_leg(model, told):
    weak = registry.make("servo_gain", servo="right_front", factor=0.5)
    trials = walk_cases.record(told, [weak], 1)
    kept = [item for item in model.suspected(trials) if item.name in KEPT]
    made = diagnose.analyse(trials, model, candidates=kept, most=1)
    assert made.verdict.named == (("servo_gain[right_front]",),)
    assert made.choice.best.terms[0].magnitude == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("kind", ["single", "lost"])
def test_cases_hide_an_effect_and_say_which(model, kind):
    case = walk_cases.build(3, kind, model)
    again = walk_cases.build(3, kind, model)
    assert case.term == again.term
    assert case.term is not None
    assert (case.term.magnitude == 1.0) >= (kind == "lost")
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
    kept = [item for item in model.suspected(usable) if item.name in wanted]
    made = diagnose.analyse(trials, model, candidates=kept, most=1)
    assert made.verdict.named == ((named,),)
    (term,) = made.choice.best.terms
    assert term.magnitude == pytest.approx(1.0, abs=0.02)
    assert not term.at_bound
    assert uncertainty.spreads(made.problem, made.choice.best)[1] == pytest.approx(1.0)


def test_play_in_a_horn_is_named_with_its_joint(model, told):
    loose = registry.make("loose_horn", joint="left_front_femur", angle=0.3)
    trials = walk_cases.record(told, [loose], 1)
    others = ("loose_horn[left_front_tibia]", "servo_offset[left_front_femur]")
    wanted = ("loose_horn[left_front_femur]", *others)
    kept = [item for item in model.suspected(trials) if item.name in wanted]
    made = diagnose.analyse(trials, model, candidates=kept, most=1)
    assert made.verdict.named == ((wanted[0],),)
    assert made.choice.best.terms[0].magnitude == pytest.approx(0.3, abs=0.02)


def test_joints_that_follow_or_are_told_nothing_else_show_no_sign(model, told):
    assert not _signs(model, walk_cases.record(told, [], 1)).joints
    still = [Commands(np.zeros((2, 18)), [0.5, 0.5], told[0].channels)]
    assert not _signs(model, walk_cases.record(still, [], 1)).joints


def _signs(model, trials):
    (predicted,) = model.simulate(trials, [()])
    return model.signs(trials, predicted)


def test_blind_cases_are_made_of_walkers_of_ones_own():
    quad = WalkModel(str(ROOT / "examples" / "quad"))
    plain = walk_bench.build(1, "none", quad)
    assert plain.answer.names == () and len(plain.answer.nominal) == 4
    assert len(plain.trials[0].channels) == 3 + len(quad.joints)
    case = walk_cases.build(3, "lost", quad)
    assert "middle" not in case.term.candidate.name
    assert not any(trial.outcome.fell for trial in case.trials)


def test_robots_that_lack_a_leg_scatter_as_such_robots_do(model):
    """A limp leg lets the robot tip now and then, which is no gap beside the leg."""
    case = walk_cases.build(10, "lost", model)
    name = case.term.candidate.name
    assert name == "leg_limp[left_rear]"
    listed = model.suspected(case.trials)
    kept = [item for item in listed if item.slack > 0 or item.name == name]
    made = diagnose.analyse(case.trials, model, candidates=kept, most=1)
    assert made.verdict.named == ((name,),)


def test_nothing_is_lost_where_no_loss_explains_much(model, told):
    trials = walk_cases.record(told, [], 1)
    every = legged.lost(Signs({}, (), LEGS, LEGS))
    assert lost.likely(trials, every, model.simulate) == ()
    assert lost.likely(trials, (), model.simulate) == ()


def test_two_legs_are_lost_one_after_the_other(model, told):
    limp = registry.make("leg_limp", legs="1,5", loss=1.0)
    trials = walk_cases.record(told, [limp], 1)
    every = legged.lost(Signs({}, (), LEGS, ()))
    found = lost.likely(trials, every, model.simulate)
    assert {effect["legs"] for effect in found} == {"1", "5"}
