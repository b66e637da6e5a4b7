"""What a description does not list, where that explains what its effects leave."""

from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.bench import mjcf_cases
from bns.gap.decomposition.diagnosis import explains_more, widened
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import effects
from bns.viz.gap import report
from tests.gap.own_robots import MOTORS, arm, of_motors

LISTED = """
actuator_gain = ["hip", "calf"]
joint_armature = ["FL_calf_joint"]
"""
GAIN = ("actuator_gain", {"part": "hip", "factor": 1.2})
FRICTION = ("joint_friction", {"part": "FL_calf_joint", "added": 0.1})
RUBS = "joint_friction[FL_calf_joint]"


def diagnosis(folder, *planted):
    """Of an arm whose description lists gains and an armature."""
    robot = arm(folder, MOTORS, of_motors(LISTED))
    told = mjcf_cases.commands(robot, np.random.default_rng(0), 3)
    made = [effects.make(name, values) for name, values in planted]
    return diagnose(mjcf_cases.record(robot, told, made), robot, full=False)


def test_a_cause_that_is_not_listed_is_named_beside_the_verdict(tmp_path):
    found = diagnosis(tmp_path, FRICTION)
    assert found.verdict.kind == "none of the library"
    assert found.verdict.change == f"List in [effects] what explains it: {RUBS}."
    assert found.decomposition["unlisted"] == [RUBS]
    assert f"[effects] does not list, {RUBS} = 0.0999" in found.verdict.sentence
    assert report.title(found) == f"Not listed in [effects]: {RUBS}"
    assert [part["name"] for part in found.decomposition["parts"]] == [RUBS]
    assert found.signatures["best"] == [found.fits[0].effects[0]]  # that is drawn
    assert found.closed["closed"] > 0.9


def test_what_listed_effects_imitate_is_told_with_those_that_are_right(tmp_path):
    found = diagnosis(tmp_path, GAIN, FRICTION)
    assert found.decomposition["unlisted"] == [RUBS, "actuator_gain[hip]"]
    assert found.verdict.kind == "none of the library"  # two gains imitate it


def test_nothing_further_is_searched_where_the_listed_effects_explain_all(tmp_path):
    found = diagnosis(tmp_path, GAIN)
    assert found.verdict.named == (("actuator_gain[hip]",),)
    assert "unlisted" not in found.decomposition


def test_nothing_further_is_searched_where_there_is_no_gap():
    made = SimpleNamespace(
        kind="no gap", lasting=False, failing=False, after=5.0, unexplained=0.9
    )
    assert widened(made) is made  # within what a simulation is exact to


@pytest.mark.parametrize(
    ("shares", "told"), [((0.98, 0.004), True), ((0.7, 0.3), False)]
)
def test_explanations_that_close_a_trifle_do_not_count(shares, told):
    one = SimpleNamespace(support=frozenset({"a"}))
    made = SimpleNamespace(
        point=one, after=9.0, problem=SimpleNamespace(terms={"a": ()})
    )
    other = SimpleNamespace(
        point=SimpleNamespace(support=frozenset({"b", "c"})),
        parts=[SimpleNamespace(last=share) for share in shares],
        after=1.0,
        foreign=False,
    )
    assert explains_more(made, other) is told
