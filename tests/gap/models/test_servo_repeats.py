"""Runs of a servo that stand still or stray are found by their repeats, and named."""

from dataclasses import replace

import numpy as np
import pytest

from bns.gap.models.servo import diagnosis, repeats
from bns.gap.models.servo.candidates import candidates
from bns.gap.models.servo.runs import Runs
from bns.gap.models.servo.verdict import LEVEL, MANY, Null
from tests.gap.models.test_servo import CELLS, NAMES, NOMINAL, recorded

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
