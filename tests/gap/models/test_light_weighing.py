"""Explanations of readings weighed by the likelihood of every reading."""

import numpy as np
import pytest

from bench.gap.sensors import _likened
from bench.gap.strange_effects import Coarse
from bns.gap import diagnose
from bns.gap.bench import light_cases
from bns.gap.core.fit import Term
from bns.gap.core.problem import Problem
from bns.gap.models.light.diagnosis import light_rules
from bns.gap.models.light.model import SightModel, squeezed, stretched
from bns.gap.models.light.ranking import weighed
from bns.gap.models.light.weighing import Readings, apart
from bns.worlds.effects import registry

NOISE = registry.make("tracker_noise", position_sd=0.001, heading_sd=0.008)
KEPT = ("sensor_gain[all]", "sensor_offset[all]", "light_dimmed", "sensor_drift[all]")


def analysis(*effects):
    trials = light_cases.record(5, [*effects, NOISE], singles=False)
    sight = SightModel(trials, pose_sd=(1e-3, 1e-3, 8e-3))
    few = [item for item in sight.candidates() if item.name in KEPT]
    return diagnose.analyse(trials, sight, candidates=few, rules=light_rules())


def term(problem, name, magnitude):
    (item,) = [c for c in problem.model.candidates() if c.name == name]
    return Term.at(item, 0, magnitude)


@pytest.fixture(scope="module")
def offset():
    """Readings 300 counts too bright, diagnosed by the search alone."""
    return analysis(registry.make("sensor_offset", sensor="all", counts=-300.0))


def test_departures_come_back_from_limited_ones():
    seen = np.array([-30.0, -1.0, 0.0, 0.3, 12.0])
    assert stretched(squeezed(seen)) == pytest.approx(seen)


def test_a_magnitude_is_found_from_far_off(offset):
    readings = Readings(offset.problem)
    found = readings.weigh([term(offset.problem, "sensor_offset[all]", -150.0)])
    assert found.terms[0].magnitude == pytest.approx(-300.0, abs=5.0)
    assert found.scatter == pytest.approx(1.0, abs=0.2)
    at_start = readings.weigh([term(offset.problem, "sensor_intermittent[all]", 3.0)])
    assert at_start.terms[0].magnitude == 3.0


def test_what_always_looks_alike_has_no_distance(offset):
    problem: Problem = offset.problem
    gain = term(problem, "sensor_gain[left]", 0.95)
    others = [
        term(problem, "sensor_stuck_min[left]", 0.06),
        term(problem, "sensor_gain[right]", 0.95),
        term(problem, "sensor_noise[left]", 1.2),
    ]
    found = apart(problem, gain, others)
    assert found["sensor_stuck_min[left]"] < 0.2
    assert found["sensor_gain[right]"] > 10
    assert found["sensor_noise[left]"] > 5


def test_the_order_is_that_of_the_likelihood(offset):
    made = weighed(offset)
    assert made.verdict.kind == "effect"
    assert made.verdict.named == (("sensor_offset[all]",),)
    assert made.choice.best.terms[0].magnitude == pytest.approx(-300.0, abs=5.0)
    assert made.choice.rung.scores[0][1] == 0
    assert made.search.best(1).names == made.choice.best.names


def test_readings_in_steps_are_no_effect_of_the_library():
    """They follow a gain on average; about it they scatter too much."""
    made = analysis(Coarse())
    assert made.verdict.kind in ("effect", "either")
    assert weighed(made).verdict.kind == "none of the library"


def test_without_a_gap_nothing_is_weighed():
    made = analysis()
    assert made.verdict.kind == "no gap"
    assert weighed(made) is made


def test_what_the_likelihood_cannot_tell_is_merged():
    row = {"answer": {"aliases": [["a"], ["b"]], "near": [[["c", 1.6, 5.0]], []]}}
    assert _likened(row)["answer"]["aliases"] == [["a", "c"], ["b"]]
    row["answer"]["near"][0][0][1] = 1.7
    assert _likened(row)["answer"]["aliases"] == [["a"], ["b"]]
    row["answer"]["near"] = []
    assert _likened(row)["answer"]["aliases"] == [["a"], ["b"]]
