"""Known answers: planted effects are named, nothing is "no gap", aliases are sets."""

from dataclasses import replace

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.gap.core import fit, segments, select, signatures, verdict
from bns.gap.core.problem import Problem
from bns.gap.core.reference import Reference
from bns.gap.diagnose import diagnose
from bns.gap.recordings import check
from bns.gap.records import Candidate, Diagnosis
from bns.worlds.effects.base import CommandEffect, Parameter
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import Channel, Commands

NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.01"
KEPT = (
    "axle_length",
    "command_latency",
    "dead_band[left]",
    "motor_lag[both]",
    "tracker_latency",
    "tracker_scale",
    "wheel_gain[left]",
    "wheel_gain[both]",
)


@pytest.fixture(scope="module")
def find(model, told):
    few = tuple(item for item in model.candidates() if item.name in KEPT)

    def run(*effects, full=False):
        world = MujocoWorld(reality=[*effects, NOISE], threads=1)
        trials = world.run(told, seeds=range(len(told)))
        return diagnose(trials, model, candidates=few, full=full)

    return run


def test_nothing_planted_is_no_gap(find):
    found = find()
    assert found.verdict.kind == "no gap"
    assert found.verdict.named == ()
    assert found.verdict.p_gap > 0.02


@pytest.mark.parametrize(
    ("text", "name", "value", "tolerance"),
    [
        ("wheel_gain:wheel=left,factor=0.85", "wheel_gain[left]", 0.85, 0.01),
        ("dead_band:wheel=left,speed=0.04", "dead_band[left]", 0.04, 0.02),
        ("motor_lag:time_constant=0.15", "motor_lag[both]", 0.15, 0.01),
    ],
)
def test_one_effect_is_named_with_its_value(find, text, name, value, tolerance):
    found = find(text)
    assert found.verdict.kind == "effect"
    assert found.verdict.named == ((name,),)
    assert found.best.magnitudes[0] == pytest.approx(value, abs=tolerance)
    assert name in found.verdict.sentence


def test_a_simulated_recording_without_noise_is_named(model, told):
    few = tuple(item for item in model.candidates() if item.name in KEPT)
    world = MujocoWorld(reality=["wheel_gain:wheel=left,factor=0.85"], threads=1)
    found = diagnose(world.run(told), model, candidates=few, full=False)
    assert found.verdict.kind == "effect"
    assert found.verdict.named == (("wheel_gain[left]",),)


def test_an_alias_is_never_a_single_name(find):
    found = find("command_latency:delay=0.12")
    assert found.verdict.kind == "either"
    named = {names for names in found.verdict.named}
    assert {("command_latency",), ("tracker_latency",)} <= named
    assert found.verdict.angle < 5
    assert "steps in speed" in found.verdict.change


def test_two_effects_together(find):
    found = find("wheel_gain:wheel=left,factor=0.85", "motor_lag:time_constant=0.15")
    assert found.verdict.kind == "together"
    assert set(found.verdict.named[0]) == {"wheel_gain[left]", "motor_lag[both]"}


class Ripple(CommandEffect):
    name = "test_ripple"
    doc = "speed swings with the angle of the wheel"
    parameters = (Parameter("size", "1", 0.0, 0.0, 1.0, "assumed", 0.4),)

    def apply(self, signal, active, rng):
        values = signal.values.copy()
        angle = np.cumsum(values[:, 0]) * signal.dt / 0.02
        values[:, 0] *= 1 + self["size"] * np.sin(angle)
        return values


def test_an_effect_outside_the_library_is_none_of_it(find):
    found = find(Ripple({"size": 0.3}))
    assert found.verdict.kind == "none of the library"
    assert found.verdict.named == ()
    assert found.decomposition["left"] > 0.9


def test_recordings_without_a_change_make_the_nominal_model_surer(model, told):
    few = tuple(item for item in model.candidates() if item.slack)
    off = ["axle_length:factor=1.006", NOISE]
    before = MujocoWorld(reality=off, threads=1).run(told, seeds=range(4))
    planted = ["axle_length:factor=0.993", NOISE]
    after = MujocoWorld(reality=planted, threads=1).run(told, seeds=range(4, 8))
    known = Reference.of(before, model, few)
    place = [item.name for item in few].index("axle_length")
    assert known.mean[place] * few[place].slack == pytest.approx(0.006, abs=0.001)
    alone = Problem.of(after, model, candidates=few)
    better = known.problem(after, model)
    effect = [[few[place].make(0.987)]]  # 0.993 / 1.006
    seen = [np.linalg.norm(p.signatures(effect)) for p in (alone, better)]
    assert seen[1] > 2 * seen[0]
    # the empty recording fits: what was off before is no gap
    same = MujocoWorld(reality=off, threads=1).run(told, seeds=range(8, 12))
    rest = known.problem(same, model).rest
    assert (rest**2).mean() == pytest.approx(1.0, abs=0.25)


def test_where_and_how_far(find):
    found = find("dead_band:wheel=left,speed=0.05", full=True)
    share = dict(zip(("left", "right"), found.where["wheels"]["share"], strict=True))
    assert share["left"] > 0.8
    assert found.closed["closed"] > 0.95
    assert found.closed["before"] > found.closed["after"]
    late = find("command_latency:delay=0.12", full=True)
    assert late.where["phase"]["turn"]["delay"] == pytest.approx(0.12, abs=0.03)


def test_a_diagnosis_survives_json(find):
    found = find("wheel_gain:wheel=left,factor=0.85")
    read = Diagnosis.from_json(found.to_json())
    assert read.verdict.named == found.verdict.named
    assert read.best.magnitudes == found.best.magnitudes
    with pytest.raises(FormatError):
        Diagnosis.from_json("{}")


def test_the_same_seed_gives_the_same_diagnosis(find):
    first, second = find(full=True), find(full=True)
    assert first.verdict == second.verdict
    assert first.where == second.where


def test_further_channels_do_not_count(model, told):
    trials = MujocoWorld(reality=[NOISE], threads=1).run(told, seeds=range(4))
    more = [
        trial.replace(
            observed=np.hstack(
                [trial.observed, np.full_like(trial.observed[:, :1], 7)]
            ),
            channels=(*trial.channels, Channel("battery", "V")),
        )
        for trial in trials
    ]
    plain, wide = (Problem.of(which, model) for which in (trials, more))
    assert np.array_equal(plain.rest, wide.rest)
    assert np.array_equal(plain.floor.sigma, wide.floor.sigma)


def test_the_distance_to_a_curve_is_taken_along_it(model):
    curves = signatures.Curves(
        model.candidates()[:1],
        np.zeros(1, dtype=int),
        np.zeros(1, dtype=int),
        np.array([1.1]),
        np.array([[3.0, 0.0]]),
        (),
    )
    gaps, at = signatures.nearest(curves, np.array([1.5, 2.0]))
    assert gaps[0] == pytest.approx(4.0)
    assert at[0] == 0


def test_fits_end_on_the_simulation_itself(model, told):
    drag = "rolling_drag:wheel=left,torque=0.0002"
    trials = MujocoWorld(reality=[drag, NOISE], threads=1).run(told, seeds=range(4))
    problem = Problem.of(trials, model)
    item = next(c for c in model.candidates() if c.name == "rolling_drag.torque[left]")
    point = fit.refine(problem, [fit.Term.at(item, 0, 0.0003)])
    (true,) = fit.evaluate(problem, [point.terms])
    (rough,) = fit.evaluate(problem, [point.terms], rough=True)
    assert point.loss == pytest.approx(true.loss)
    assert abs(rough.loss - true.loss) > 1.0  # else the test shows nothing
    around = [point.terms[0].magnitude * share for share in (0.99, 1.01)]
    near = fit.evaluate(problem, [[fit.Term.at(item, 0, value)] for value in around])
    assert point.loss < min(other.loss for other in near) + 0.5


def test_stitched_pieces_keep_the_path():
    path = np.cumsum(np.random.default_rng(0).normal(size=(30, 3)), axis=0)
    parts = [path[:11], segments.moved(path[10:], np.array([5.0, -1.0, 2.0]))]
    assert np.allclose(segments.stitched(parts), path)


def test_every_candidate_makes_its_effect(model):
    names = [item.name for item in model.candidates()]
    assert len(set(names)) == len(names)
    for item in model.candidates():
        for branch in range(len(item.branches)):
            for value in item.grid:
                assert not item.make(value, branch).is_nominal
    with pytest.raises(BnsError, match="grid"):
        Candidate("x", "wheel_gain", "factor", "1", 1.0, 0.0, 2.0, grid=(3.0,))


def test_no_support_fits_worse_than_one_it_contains(model):
    items = {item.name: item for item in model.candidates()}
    gain, lag = items["wheel_gain[left]"], items["motor_lag[both]"]
    one = fit.Point((fit.Term.at(gain, 0, 0.9),), np.ones(3), 3.0, np.ones((1, 3)))
    worse = (fit.Term.at(lag, 0, 0.3), fit.Term.at(gain, 0, 0.8))
    two = fit.Point(worse, np.full(3, 2.0), 12.0, np.ones((2, 3)))
    (made,) = select.nested([two], [one])
    assert made.loss == 3.0
    assert set(made.names) == {"wheel_gain[left]", "motor_lag[both]"}
    assert [term.magnitude for term in made.terms] == [0.9, lag.nominal]
    assert made.slopes.shape == (2, 3)
    better = replace(two, loss=2.0)
    assert select.nested([better], [one]) == (better,)


def test_dead_bands_are_tried_between_the_speeds_told(model):
    items = {item.name: item for item in model.candidates()}
    there = Commands([[0.02, 0.05], [-0.04, 0.1]], [1.0, 1.0])
    trials = MujocoWorld(threads=1).run([there])
    steps = model.steps(items["dead_band[left]"], trials)
    assert steps[:2] == pytest.approx((0.03, 0.12))
    assert model.steps(items["dead_band[both]"], trials)[0] == pytest.approx(0.03)


def test_channels_have_to_fit(model, told):
    (trial,) = MujocoWorld(threads=1).run(told[:1])
    renamed = (Channel("x", "mm"), *trial.channels[1:])
    with pytest.raises(FormatError, match="convert it to SI"):
        check.check([trial.replace(channels=renamed)], model)
    (short,) = MujocoWorld(threads=1).run([Commands([[0.1, 0.1]], [3.0])])
    with pytest.raises(BnsError, match="needs 2"):
        diagnose([short], model)


def test_conformal_quantile_covers():
    rng = np.random.default_rng(0)
    scores = rng.exponential(size=199)
    threshold = verdict.quantile(scores, 0.9)
    assert (scores <= threshold).mean() >= 0.9
    assert (rng.exponential(size=20_000) <= threshold).mean() == pytest.approx(
        0.9, abs=0.06
    )


def test_a_small_rest_beside_a_large_effect_takes_no_name_away(find):
    found = find("wheel_gain:wheel=left,factor=0.6", Ripple({"size": 0.4}))
    assert found.verdict.named == (("wheel_gain[left]",),)
    assert "is explained by no effect of the library" in found.verdict.sentence
    assert "mm forward" in found.verdict.sentence
