"""Recordings with light: sensor effects are named, motion and light stay apart."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bns.cli.gap import after
from bns.errors import BnsError
from bns.gap import stages
from bns.gap.bench import light_cases
from bns.gap.candidates import light
from bns.gap.decomposition import descent
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.shares import HeldOut
from bns.gap.diagnose import diagnose, single
from bns.gap.models.light import diagnosis
from bns.gap.models.light.model import SightModel, sees, unlikely
from bns.gap.models.light.reader import _clipped
from bns.gap.models.wheeled.model import WheeledModel
from bns.gap.records import Verdict
from bns.worlds.effects import registry
from bns.worlds.trial import Commands, Trial

NOISE = registry.make("tracker_noise", position_sd=0.001, heading_sd=0.008)
KEPT = (
    "sensor_gain[left]",
    "sensor_noise[front_left]",
    "sensor_intermittent[right]",
    "sensor_frozen[left_45]",
    "light_dimmed",
    "light_displaced",
)


def recorded(*effects, singles=True):
    return light_cases.record(5, [*effects, NOISE], singles=singles)


@pytest.fixture(scope="module")
def find():
    def run(*effects, singles=True):
        trials = recorded(*effects, singles=singles)
        sight = SightModel(trials, pose_sd=(1e-3, 1e-3, 8e-3))
        return diagnosis.look(trials, sight, single, rows=KEPT, full=False).verdict

    return run


def test_a_reading_stuck_at_zero_in_part_is_a_gain():
    readings = np.linspace(0, 4095, 22).reshape(2, 11)
    names = tuple(f"ir_{name}" for name in light.FORWARD) + tuple("abcde")
    on, rng = np.ones(2, dtype=bool), np.random.default_rng(0)
    gain = registry.parse("sensor_gain:sensor=left_45,factor=0.8")
    stuck = registry.parse("sensor_stuck_min:sensor=left_45,blend=0.2")
    one, other = (
        effect.apply(np.arange(2.0), readings, names, on, rng)
        for effect in (gain, stuck)
    )
    assert one == pytest.approx(other, abs=0.51)
    assert not np.allclose(one, readings)
    found = {row.name: row.aliases for row in light.rows(singles=True)}
    assert found["sensor_gain[left_45]"] == ("sensor_stuck_min[left_45]",)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("sensor_gain:sensor=left,factor=0.95", "sensor_gain[left]"),
        ("sensor_noise:sensor=front_left,factor=2.5", "sensor_noise[front_left]"),
        ("sensor_intermittent:sensor=right,every=6", "sensor_intermittent[right]"),
        ("sensor_frozen:sensor=left_45,blend=0.2", "sensor_frozen[left_45]"),
        ("light_displaced:x=0.05,y=-0.05", "light_displaced"),
    ],
)
def test_a_planted_effect_is_named(find, text, name):
    answer = find(registry.parse(text))
    assert answer.kind == "effect"
    assert answer.named == ((name,),)


def test_nothing_planted_is_no_gap(find):
    assert find().kind == "no gap"


def test_a_sensor_that_always_reads_least_did_not_freeze_so():
    stuck = registry.parse("sensor_stuck_min:sensor=left_90,blend=1")
    trials = recorded(stuck)
    sight = SightModel(trials, pose_sd=(1e-3, 1e-3, 8e-3))
    names = [f"sensor_{name}[left_90]" for name in ("frozen", "gain", "stuck_min")]
    found = diagnosis.look(trials, sight, single, rows=names, full=False).verdict
    assert {name for (name,) in found.named} == set(names[1:])


def test_a_fit_that_leaves_nothing_at_all_can_be_held_out():
    """In full light all readings are the same, to the count."""
    trials = recorded(singles=False)
    sight = SightModel(trials)
    problem = Problem.of(sight.ready(trials)[0], sight)
    point = descent.nothing(problem)
    exact = replace(point, rest=np.zeros_like(point.rest))
    error = HeldOut.of(problem, exact).error(())
    assert np.isfinite(error).all()


def test_the_two_virtual_sensors_are_enough(find):
    dimmed = registry.make("light_dimmed", factor=0.85)
    assert find(dimmed, singles=False).named == (("light_dimmed",),)


def test_whitened_readings_are_standard_normal():
    trials = recorded()
    sight = SightModel(trials, pose_sd=(1e-3, 1e-3, 8e-3))
    ready, notes = sight.ready(trials)
    seen = np.concatenate([trial.observed[:, 3:] for trial in ready])
    assert notes == ()
    count = len(sight.names)
    assert seen[:, :count].std() == pytest.approx(1.0, abs=0.07)
    assert seen[:, count:].std() == pytest.approx(1.0, abs=0.1)
    assert abs(seen[:, :count].mean()) < 0.05


def test_clipped_normal_numbers_have_the_moments_of_a_sample():
    rng = np.random.default_rng(0)
    drawn = np.clip(rng.normal(100.0, 80.0, 400_000), 0.0, 180.0)
    low, high = np.array(0.0), np.array(180.0)
    mean, variance = _clipped(np.array(100.0), np.array(80.0), low, high)
    assert mean == pytest.approx(drawn.mean(), abs=0.5)
    assert np.sqrt(variance) == pytest.approx(drawn.std(), abs=0.5)


def test_scatter_does_not_grow_without_end():
    assert unlikely(np.array([0.0, 1e3])) == pytest.approx([0.0, 1.0])


def test_a_lamp_is_displaced_by_two_numbers():
    sight = SightModel(recorded())
    sight.rows(())
    values = {"light_displaced.x": 0.2, "light_displaced.y": -0.1}
    effect = sight.effect("light_displaced", values)
    assert (effect["x"], effect["y"]) == (0.2, -0.1)


def test_the_virtual_sensors_have_no_rows_behind():
    names = [row.name for row in light.rows(singles=False)]
    assert "sensor_gain[left_45]" in names
    assert not [name for name in names if "back" in name]


def test_stretches_in_which_the_robot_was_handled_are_cut_out():
    told = Commands(np.full((20, 2), 0.05), np.full(20, 0.4))
    times = np.arange(81) * 0.1
    handled = np.zeros(20, bool)
    handled[8] = True
    trial = Trial(
        told,
        times,
        np.zeros((81, 3)),
        np.arange(21) * 4,
        handled=handled,
        robot="khepera3",
    )
    parts = diagnosis.unhandled([trial], WheeledModel(threads=1))
    assert [len(part.commands) for part in parts] == [8, 11]
    assert parts[1].times[0] == pytest.approx(3.6)


def verdict(kind, *names, p_gap=0.5):
    given = tuple((name,) for name in names)
    return Verdict(kind, given, given or ((),), 90.0, p_gap, 0.5, (), 9.0, "words")


def test_verdicts_on_motion_and_light_join():
    nothing, gain = verdict("no gap"), verdict("effect", "a", p_gap=0.001)
    assert diagnosis.merged(nothing, nothing).kind == "no gap"
    alone = diagnosis.merged(nothing, gain)
    assert (alone.kind, alone.named) == ("effect", (("a",),))
    assert alone.p_gap == pytest.approx(0.002)
    both = diagnosis.merged(verdict("effect", "w"), gain)
    assert (both.kind, both.named) == ("together", (("w", "a"),))
    tied = diagnosis.merged(verdict("either", "w", "v"), gain)
    assert (tied.kind, len(tied.named)) == ("either", 2)
    strange = replace(nothing, kind="none of the library")
    assert diagnosis.merged(strange, gain).kind == "none of the library"


def test_of_many_supports_those_listed_are_joined():
    listed = SimpleNamespace(names=("a",))
    many = SimpleNamespace(fits=[listed], verdict=verdict("either", "a", "b"))
    assert diagnosis._named(many) == [listed]


def test_a_recording_with_light_is_diagnosed_whole():
    gain = registry.make("sensor_gain", sensor="right", factor=0.9)
    slow = registry.make("wheel_gain", wheel="left", factor=0.9)
    trials = recorded(slow, gain, singles=False)
    model = WheeledModel(threads=1)
    wanted = ("wheel_gain[left]", "tracker_scale")
    assert sees(trials)
    names = (*wanted, *KEPT, "sensor_gain[right]")
    heard: list[str] = []
    found = diagnose(trials, model, rows=names, tell=heard.append)
    assert heard == list(stages.shares(model, trials))
    assert found.verdict.kind == "together"
    assert found.verdict.named == (("wheel_gain[left]", "sensor_gain[right]"),)
    assert found.best.magnitudes == pytest.approx((0.9, 0.9), abs=0.01)
    assert json.loads(found.to_json())["verdict"]["kind"] == "together"


def test_ties_on_light_have_no_plan():
    names = ("sensor_gain[left]", "sensor_stuck_min[left]")
    texts = (
        "sensor_gain:sensor=left,factor=0.8",
        "sensor_stuck_min:sensor=left,blend=0.2",
    )
    fits = [
        SimpleNamespace(names=(name,), effects=(text,))
        for name, text in zip(names, texts, strict=True)
    ]
    tied = SimpleNamespace(
        verdict=verdict("either", *names), fits=fits, floor={"light": {}}
    )
    with pytest.raises(BnsError, match=r"part sensor_gain\[left\], sensor_stuck_min"):
        after._plannable(tied, WheeledModel(threads=1))


@pytest.mark.parametrize(
    ("model", "floor", "base"),
    [
        ("khepera3", {}, "mujoco"),
        ("khepera3", {"light": {}}, "light"),
        ("phantomx", {}, "hexapod"),
    ],
)
def test_a_corrected_world_is_of_the_recording_s_kind(model, floor, base):
    assert after._base(SimpleNamespace(model=model, floor=floor))[0] == base
