"""Known answers: planted effects are named, nothing is "no gap", aliases are sets.

Effects that look alike at one speed are told apart by others. Of a diagnosis that was
killed the same command again is possible, another is not.
"""

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.gap import request, stages
from bns.gap.decomposition import descent, refit
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.reference import Corrected
from bns.gap.diagnose import diagnose
from bns.gap.models.wheeled.model import WheeledModel
from bns.gap.planning import excitation
from bns.gap.recordings import check
from bns.gap.records import Diagnosis
from bns.gap.stages import BY_FITS, BY_TANGENT, OF_MANY, WITH_LIGHT
from bns.storage.files import TEMPORARY
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
    def run(*effects, full=False):
        world = MujocoWorld(reality=[*effects, NOISE], threads=1)
        trials = world.run(told, seeds=range(len(told)))
        return diagnose(trials, model, rows=KEPT, full=full)

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
    world = MujocoWorld(reality=["wheel_gain:wheel=left,factor=0.85"], threads=1)
    trials, heard = world.run(told), []
    found = diagnose(trials, model, rows=KEPT, full=False, tell=heard.append)
    assert heard == list(stages.shares(model, trials))
    assert found.verdict.kind == "effect"
    assert found.verdict.named == (("wheel_gain[left]",),)


@pytest.mark.parametrize("shares", [BY_TANGENT, BY_FITS, OF_MANY, WITH_LIGHT])
def test_stages_share_the_time_of_a_diagnosis(shares):
    assert sum(shares.values()) == pytest.approx(1.0)
    assert min(shares.values()) > 0


def test_an_alias_is_never_a_single_name(find):
    found = find("command_latency:delay=0.12")
    assert found.verdict.kind == "either"
    named = {names for names in found.verdict.named}
    assert {("command_latency",), ("tracker_latency",)} <= named
    assert found.verdict.angle < 5
    assert "the same whatever is commanded" in found.verdict.change


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
    off = ["axle_length:factor=1.03", NOISE]
    before = MujocoWorld(reality=off, threads=1).run(told, seeds=range(4))
    known = Corrected.of(check.check(before, model)[0], model)
    assert known.moved["axle_length"] == pytest.approx(0.03, abs=0.005)
    # what was off before is no gap, and what came since is
    planted = ["axle_length:factor=1.03", "wheel_gain:wheel=left,factor=0.85", NOISE]
    after = MujocoWorld(reality=planted, threads=1).run(told, seeds=range(4, 8))
    found = diagnose(after, model, rows=KEPT, reference=before, full=False)
    assert found.verdict.named == (("wheel_gain[left]",),)
    same = MujocoWorld(reality=off, threads=1).run(told, seeds=range(8, 12))
    found = diagnose(same, model, rows=KEPT, reference=before, full=False)
    assert found.verdict.kind == "no gap"


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
    assert np.array_equal(plain.recorded, wide.recorded)
    assert np.array_equal(plain.gap, wide.gap)


def test_an_effect_is_simulated_as_its_row_is(model, told):
    """What a diagnosis names is what its fit simulated."""
    trials = MujocoWorld(reality=[NOISE], threads=1).run(told[:1], seeds=[1])
    rows = model.rows(trials)
    for name, value in (
        ("motor_lag[left]", 0.12),
        ("marker_mount.dx", 0.02),
        ("tracker_latency", 0.05),
        ("axle_length", 0.95),
    ):
        (row,) = [row for row in rows if row.name == name]
        ((by_row,),) = model.paths(trials, [[{name: value}]])
        effect = model.effect(row.term, {name: value})
        ((by_effect,),) = model.simulate(trials, [[effect]])
        assert np.abs(by_row - by_effect).max() < 1e-9, name


def test_channels_have_to_fit(model, told):
    (trial,) = MujocoWorld(threads=1).run(told[:1])
    renamed = (Channel("x", "mm"), *trial.channels[1:])
    with pytest.raises(FormatError, match="convert it to SI"):
        check.check([trial.replace(channels=renamed)], model)
    (short,) = MujocoWorld(threads=1).run([Commands([[0.1, 0.1]], [3.0])])
    with pytest.raises(BnsError, match="needs 2"):
        diagnose([short], model)


def test_a_small_rest_beside_a_large_effect_takes_no_name_away(find):
    found = find("wheel_gain:wheel=left,factor=0.6", Ripple({"size": 0.4}))
    assert found.verdict.named == (("wheel_gain[left]",),)
    assert "is explained by no effect of the library" in found.verdict.sentence
    assert "mm forward" in found.verdict.sentence


ASKED = {"data": ["drives"], "seed": 0}


def test_a_killed_one_may_be_repeated(tmp_path):
    request.begin(tmp_path, ASKED)
    (tmp_path / "diagnosis.json").write_text("{}")
    (tmp_path / f"{TEMPORARY}1-report.html").write_text("half")
    request.begin(tmp_path, ASKED)
    held = {path.name for path in tmp_path.iterdir()}
    assert held == {"request.json", "diagnosis.json"}


def test_another_one_is_refused_and_changes_nothing(tmp_path):
    request.begin(tmp_path, ASKED)
    with pytest.raises(BnsError, match="unfinished diagnosis of something else"):
        request.begin(tmp_path, ASKED | {"seed": 1})
    request.begin(tmp_path, ASKED)


@pytest.mark.parametrize("name", ["diagnosis.json", "notes.txt"])
def test_what_is_there_is_not_overwritten(tmp_path, name):
    (tmp_path / name).write_text("{}")
    with pytest.raises(BnsError, match="not overwritten"):
        request.begin(tmp_path, ASKED)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_one_that_could_not_be_finished_may_be_asked_otherwise(tmp_path):
    request.begin(tmp_path, ASKED)
    (tmp_path / "partial.json").write_text("{}")
    request.drop(tmp_path)
    request.begin(tmp_path, ASKED | {"seed": 1})
    request.end(tmp_path)
    assert not any(tmp_path.iterdir())


TURNING_NOISE = "tracker_noise:position_sd=0.001,heading_sd=0.008"
DRAG = "rolling_drag:wheel=both,torque=1e-4,viscous=0"
NAMES = "rolling_drag.torque[both]", "rolling_drag.viscous[both]"


def test_dry_friction_is_told_from_viscous():
    model = WheeledModel("khepera3", threads=1)
    family = {item.name: item.commands for item in excitation.wheeled()}
    slow = family["medium turn in place, both ways, each for 5 s"]
    fast = family["fast turn in place, both ways, each for 1.5 s"]
    world = MujocoWorld("khepera3", reality=[DRAG, TURNING_NOISE], threads=1)
    trials = world.run([slow] * 2 + [fast] * 5, seeds=range(7))
    found = diagnose(trials, model, rows=NAMES, full=False)
    assert found.verdict.named == (("rolling_drag.torque[both]",),)
    assert abs(found.best.magnitudes[0] - 1e-4) < 1e-5


def test_a_wheel_that_sticks_is_told_from_a_dead_band():
    model = WheeledModel("khepera3", threads=1)
    sticks = "rolling_drag:wheel=right,torque=0.002,breakaway=0.004"
    speeds = [0.05, 0.09, 0.14, 0.2]
    told = [[[v, v], [0.0, 0.0], [-v, -v]] for v in speeds]
    world = MujocoWorld("khepera3", reality=[sticks, TURNING_NOISE], threads=1)
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
    world = MujocoWorld("khepera3", reality=[slips, TURNING_NOISE], threads=1)
    trials = world.run([Commands(np.array(row), np.full(4, 1.0)) for row in told * 2])
    names = ["floor_friction", "payload", "motor_lag[both]", "dead_zone[right]"]
    found = diagnose(trials, model, rows=names, full=False)
    assert found.verdict.named == (("floor_friction",),)
    assert abs(found.best.magnitudes[0] - 0.05) < 5e-3


def test_a_limit_that_came_back_to_the_nominal_explains_nothing():
    model = WheeledModel("khepera3", threads=1)
    told = Commands(np.array([[0.1, 0.1], [0.05, 0.15]]), np.array([1.0, 1.0]))
    trials = MujocoWorld("khepera3", reality=[TURNING_NOISE], threads=1).run([told] * 3)
    names = ["wheel_gain[left]", "speed_saturation[right]"]
    problem = Problem.of(trials, model)
    point = refit.fitted_at(problem, descent.nothing(problem), names)
    assert point.support == {"wheel_gain[left]"}
    assert np.isfinite(point.cost)
