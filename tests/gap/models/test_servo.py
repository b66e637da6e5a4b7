"""Servo diagnosis against planted answers, beside unchanged runs and their repeats.

Runs that the law itself made; from trials to a written diagnosis.
"""

from dataclasses import replace

import numpy as np
import pytest

from bns.errors import BnsError
from bns.gap.models.servo import diagnosis, nominal, repeats
from bns.gap.models.servo.candidates import candidates, columns
from bns.gap.models.servo.model import ServoModel
from bns.gap.models.servo.nominal import Nominal
from bns.gap.models.servo.runs import Runs, cells, merged, runs
from bns.gap.models.servo.verdict import LEVEL, MANY, Null
from bns.gap.planning import plan
from bns.gap.records import Diagnosis
from bns.models import servo_pendulum
from bns.worlds.effects import registry
from bns.worlds.physics.servo_law import law
from bns.worlds.physics.servo_rollout import Drive, simulate
from bns.worlds.trial import Channel, Commands, Trial

NAMES = ("servo_payload", "servo_lever", "servo_gain", "servo_voltage", "servo_delay")
CELLS = [(m, a, k) for m in (0.4, 0.7) for a in (0.1, 0.15) for k in (6.0, 16.0)]
SECONDS, DT = 3.0, 0.005
NOMINAL = Nominal({**servo_pendulum.law(), "stribeck": 0.0}, 0.0)
REALITY = {"coulomb": 0.13, "viscous": 0.05, "load_friction": 0.12}
"""the nominal law is wrong where the truth has these, in every run"""


def recorded(settings, effect: str = "", seed: int = 0, rate=0.15) -> Runs:
    """Runs of each setting: a sweep, and a lift with a fall, with noise."""
    rng = np.random.default_rng(seed)
    times = np.arange(round(SECONDS / DT)) * DT
    sweep = 1.2 * np.sin(2 * np.pi * rate * times**1.6)
    lift = np.minimum(times, 1.4) * 1.1
    goals = np.tile(np.stack([sweep, lift]), (len(settings), 1))
    on = np.tile(np.stack([0 * times + 1, times < 1.6]), (len(settings), 1)) > 0.5
    rows = np.repeat(np.array(settings), 2, axis=0)
    still = np.zeros(len(rows))
    told = dict(zip(("mass", "lever", "gain"), rows.T, strict=True))
    drive = Drive(goals, still, still, on, DT, round(0.01 / DT))
    numbers = {k: v[:, None] for k, v in told.items()}
    truth = law({**NOMINAL.values, **REALITY, **numbers})
    sets = [[registry.parse(effect)] if effect else []]
    angles = simulate(columns(truth, sets), drive)[:, 0]
    angles = angles + rng.normal(0, 1e-3, angles.shape)
    kinds = ("sweep", "lift") * len(settings)
    return Runs(drive, angles, told, {"trajectory": kinds})


@pytest.fixture(scope="module")
def reference():
    return diagnosis.learn(recorded(CELLS), NOMINAL, candidates=candidates(NAMES))


@pytest.mark.parametrize(
    "effect, name, magnitude",
    [
        ("servo_payload:mass=0.25", "servo_payload", 0.25),
        ("servo_lever:factor=0.7", "servo_lever", 0.7),
        ("servo_delay:delay=0.05", "servo_delay", 0.05),
    ],
)
def test_a_planted_effect_is_named_and_measured(reference, effect, name, magnitude):
    runs = recorded([(0.55, 0.12, 10.0)], effect, seed=1)
    found, scores = diagnosis.diagnose(runs, reference)
    named = {name for (name,) in found.named}
    tied = {"servo_payload", "servo_lever"}  # a little apart by their inertia alone
    assert name in named and (len(named) == 1 or named == tied)
    assert found.kind == ("effect" if len(named) == 1 else "either")
    assert scores.magnitudes[name] == pytest.approx(magnitude, rel=0.1)
    assert name in found.sentence and found.p_gap < 0.03


def test_gain_and_voltage_come_out_as_a_set(reference):
    runs = recorded([(0.55, 0.12, 16.0)], "servo_gain:factor=0.8", seed=2)
    found, scores = diagnosis.diagnose(runs, reference)
    assert found.kind == "either"
    assert {name for (name,) in found.named} == {"servo_gain", "servo_voltage"}
    assert found.angle < 5 and found.change
    assert scores.magnitudes["servo_gain"] == pytest.approx(0.8, rel=0.05)
    assert found.second[0] not in ("servo_gain", "servo_voltage")


def test_a_drive_that_saturates_tells_gain_from_voltage(reference):
    runs = recorded([(0.55, 0.12, 10.0)], "servo_gain:factor=0.6", seed=2, rate=0.35)
    found, _ = diagnosis.diagnose(runs, reference)
    assert found.kind == "effect" and found.named == (("servo_gain",),)


def test_nothing_is_nothing_though_the_nominal_is_wrong(reference):
    for seed in range(3):
        found, _ = diagnosis.diagnose(
            recorded([(0.55, 0.12, 10.0)], seed=seed), reference
        )
        assert found.kind == "no gap" and found.named == ()
        assert () in found.sets


def test_an_effect_outside_the_library_is_none_of_it(reference):
    runs = recorded([(0.55, 0.12, 10.0)], "servo_offset:angle=0.3", seed=3)
    found, _ = diagnosis.diagnose(runs, reference)
    assert found.kind == "none of the library"


def test_repeats_are_merged_and_settings_kept_apart():
    once = recorded(CELLS[:2], seed=4)
    thrice = once.take(np.repeat(np.arange(4), 3))
    both = merged(thrice)
    assert len(both) == 4 and cells(both) == cells(once)
    np.testing.assert_allclose(both.angles, once.angles)
    one = once.retold(mass=2.0)
    assert set(one.told["mass"]) == {2.0} and (one.angles == once.angles).all()


def test_a_fit_recovers_the_law():
    runs = recorded([(0.4, 0.1, 6.0), (0.7, 0.15, 16.0)])
    free = ("coulomb", "viscous", "load_friction")
    found = nominal.fit(runs, free=free, start=NOMINAL.values)
    for name in free:
        assert found.values[name] == pytest.approx(REALITY[name], abs=0.02)
    assert found.error < 2e-3 and not found.at_bound
    before = Nominal(NOMINAL.values, 0.0).predict(runs)
    assert found.error < 0.2 * np.abs(before - runs.angles).mean()


def test_trials_are_resampled_on_the_grid():
    times = np.cumsum(np.r_[0.0, np.tile([0.009, 0.011], 60)])
    goals = np.arange(len(times)) * 0.01
    told = Commands(
        np.stack([goals, 0 * goals + 1], axis=1)[:-1],
        np.diff(times),
        (Channel("goal", "rad"), Channel("torque_on", "1")),
    )
    trial = Trial(
        told,
        times,
        (2 * times)[:, None],
        np.arange(len(times)),
        channels=(Channel("angle", "rad"),),
        conditions={"mass": 0.5, "lever": 0.1, "gain": 8, "trajectory": "ramp"},
    )
    made = runs([trial], seconds=1.0)
    np.testing.assert_allclose(made.angles[0], 2 * np.arange(101) * 0.01, atol=1e-12)
    assert made.drive.speed[0] == pytest.approx(2.0)
    assert made.drive.goals[0, 4] == 0.0 and made.drive.goals[0, 5] == 0.01
    assert made.drive.torque_on is None and made.labels["trajectory"] == ("ramp",)
    with pytest.raises(BnsError, match=r"lasts 1\.20 s"):
        runs([trial], seconds=2.0)


def test_too_little_is_refused(reference):
    with pytest.raises(BnsError, match="five settings"):
        diagnosis.learn(recorded(CELLS[:4]), NOMINAL)
    with pytest.raises(BnsError, match="told 2 settings"):
        diagnosis.diagnose(recorded(CELLS[:2]), reference)
    with pytest.raises(BnsError, match="do not fix"):
        nominal.fit(recorded(CELLS[:1]).take(np.zeros(0, int)))
    odd = recorded(CELLS[:1])
    odd = Runs(odd.drive, odd.angles, odd.told, {"trajectory": ("sweep", "jump")})
    with pytest.raises(BnsError, match="trajectory 'jump'"):
        diagnosis.diagnose(odd, reference)


def test_alarms_are_weighed_by_gain():
    cells = tuple((0.1 * k, 0.1, gain) for gain in (4.0, 16.0) for k in range(1, 9))
    statistics = np.array([*np.geomspace(0.02, 0.7, 8), *np.geomspace(0.05, 0.1, 8)])
    null = Null(cells, statistics, np.ones(16))
    assert null.chance(0.4, 4.0) > 0.05  # soft control scatters
    assert null.chance(0.4, 16.0) < 1e-3
    assert null.chance(0.4, 8.0) < null.chance(0.4, 4.0)
    assert null.without(cells[:2]).chance(0.07, 16.0) > 0.3


CELLS_OF_RECORDS = [(m, 0.1, k) for m in (0.4, 0.6, 0.8) for k in (8.0, 16.0)]
DRIVES = ("slow sweep, there and back", "lift, then let fall with the motor off")
USUAL = ("servo_coulomb:torque=0.02", "servo_viscous:coefficient=0.01")


def drive(model, cell, seed, *effects):
    told = dict(zip(("mass", "lever", "gain"), cell, strict=True))
    made, rng = [], np.random.default_rng(seed)
    for item in model.excitations(told=told):
        if item.name not in DRIVES:
            continue
        blank = plan.blank(item.commands, model, "", told)
        ((angles,),) = model.simulate([blank], [effects])
        noisy = angles + rng.normal(0, 1e-3, angles.shape)
        known = {**told, "trajectory": item.name}
        made.append(blank.replace(observed=noisy, conditions=known))
    return made


@pytest.fixture(scope="module")
def model():
    return ServoModel()


@pytest.fixture(scope="module")
def usual():
    return [registry.parse(text) for text in USUAL]


@pytest.fixture(scope="module")
def unchanged(model, usual):
    rows = [drive(model, cell, n, *usual) for n, cell in enumerate(CELLS_OF_RECORDS)]
    return [trial for row in rows for trial in row]


def test_a_payload_is_named_beside_unchanged_runs(model, usual, unchanged):
    heavier = registry.parse("servo_payload:mass=0.15")
    mine = drive(model, CELLS_OF_RECORDS[0], 50, *usual, heavier)
    found = diagnosis.record(mine, [*unchanged, *mine], nominal=model.nominal)
    assert found.verdict.kind in ("effect", "either")
    assert ("servo_payload",) in found.verdict.named
    fit = next(fit for fit in found.fits if fit.names == ("servo_payload",))
    assert fit.magnitudes[0] == pytest.approx(0.15, abs=0.02)
    assert fit.intervals[0][0] <= fit.magnitudes[0] <= fit.intervals[0][1]
    assert Diagnosis.from_json(found.to_json()).verdict.named == found.verdict.named


def test_what_is_missing_is_said(model, unchanged):
    mine = drive(model, CELLS_OF_RECORDS[0], 50)
    bare = [trial.replace(conditions={"mass": 0.4}) for trial in mine]
    with pytest.raises(BnsError, match="lever, gain, trajectory"):
        diagnosis.record(bare, unchanged)
    with pytest.raises(BnsError, match="No unchanged recording"):
        diagnosis.record(mine, mine)


SECOND = 100  # samples


def repeated(settings, effect: str = "", *, times: int, seed: int = 0) -> Runs:
    """Each run several times, with its own noise."""
    once = recorded(settings, effect, seed=seed)
    runs = once.take(np.repeat(np.arange(len(once)), times))
    noise = np.random.default_rng(seed).normal(0, 1e-3, runs.angles.shape)
    number = tuple(n % times for n in range(len(runs)))
    labels = {**runs.labels, "repeat": number}
    return replace(runs, angles=runs.angles + noise, labels=labels)


def frozen(runs: Runs, at: dict[int, int]) -> Runs:
    """Some runs, by index, stand still for a second from a sample on."""
    angles = runs.angles.copy()
    for index, begin in at.items():
        angles[index, begin : begin + SECOND] = angles[index, begin]
    return replace(runs, angles=angles)


@pytest.mark.parametrize("times", [2, 3, 4])
def test_a_run_that_stands_still_is_named_and_no_other(times):
    runs = repeated(CELLS[:2], times=times)
    assert repeats.odd(runs) == {}
    last = times - 1
    stuck = frozen(runs, {0: 80, 2 * times + last: 150})
    found = repeats.odd(stuck)
    assert set(found) == {0, 2 * times + last}
    assert "sweep, mass 0.4 kg, lever 0.1 m, gain 6, repeat 0: stands still" in found[0]
    kept, lines = repeats.sound(stuck)
    assert len(kept) == len(runs) - 2 and set(lines) == set(found.values())


def test_a_run_that_stands_where_its_repeat_jumps_is_not_the_odd_one():
    runs = repeated(CELLS[:1], times=2)
    angles = runs.angles[:2].copy()
    angles[:, 60:] = angles[:, 60:61]  # both at rest, and before it one hung
    angles[1, 20:80] = angles[1, 20]
    assert set(repeats.odd(replace(runs.take(np.arange(2)), angles=angles))) == {1}


def test_two_that_freeze_at_different_times_are_both_found():
    stuck = frozen(repeated(CELLS[:1], times=4), {1: 60, 2: 170})
    assert set(repeats.odd(stuck)) == {1, 2}


def test_a_run_that_strays_is_named_where_the_others_agree():
    runs = repeated(CELLS[:1], times=4)
    angles = runs.angles.copy()
    angles[1, 100:] += 0.2
    found = repeats.odd(replace(runs, angles=angles))
    assert set(found) == {1} and "away from repeats that agree" in found[1]
    angles[2, 100:] += 0.2  # two against two: nobody is the odd one
    assert repeats.odd(replace(runs, angles=angles)) == {}


def test_a_lone_run_is_not_judged():
    stuck = frozen(recorded(CELLS[:1]), {0: 80})
    assert repeats.odd(stuck) == {}


def test_a_diagnosis_leaves_frozen_runs_out_and_says_so():
    stuck = frozen(repeated(CELLS, times=3), {1: 80, 10: 120, 20: 60, 33: 150})
    known = diagnosis.learn(stuck, NOMINAL, candidates=candidates(NAMES))
    clean = diagnosis.learn(
        repeated(CELLS, times=3), NOMINAL, candidates=candidates(NAMES)
    )
    assert len(known.left_out) == 4
    np.testing.assert_allclose(known.null.left, clean.null.left, rtol=0.2)
    heavier = repeated([(0.55, 0.12, 10.0)], "servo_payload:mass=0.25", times=2, seed=1)
    found, scores = diagnosis.diagnose(frozen(heavier, {0: 100}), known)
    assert "servo_payload" in {name for (name,) in found.named}
    assert scores.magnitudes["servo_payload"] == pytest.approx(0.25, rel=0.1)
    assert "Left out: sweep, mass 0.55 kg" in found.sentence


def test_gates_are_quantiles_where_settings_are_many():
    gains = np.tile([4.0, 8.0, 16.0, 32.0], 12)
    cells = tuple((0.1, 0.1, gain) for gain in gains)
    heavy = np.random.default_rng(0).standard_t(2, 48)  # no normal logarithms
    null = Null(cells, np.exp(heavy), np.ones(48))
    alarms = [
        null.without([cell]).chance(value, cell[-1]) <= LEVEL
        for cell, value in zip(cells, null.statistics, strict=True)
    ]
    assert 1 <= sum(alarms) <= 5
    above = np.exp(heavy.max() + 1)
    assert null.chance(above, 8.0) < LEVEL
    few = Null(cells[: MANY - 1], null.statistics[: MANY - 1], np.ones(MANY - 1))
    assert 0 < few.chance(above, 8.0) < 1
