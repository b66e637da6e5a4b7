"""One explanation for several: what is the same motion with less."""

from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.bench import mjcf_cases
from bns.gap.decomposition import descent, refit, simpler, starts
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.singles import Singles
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import effects
from tests.gap.own_robots import MOTORS, SERVOS, arm, of_motors

EFFECTS = """
actuator_gain = ["hip", "calf"]
joint_damping = ["FL_calf_joint"]
joint_friction = ["FL_calf_joint"]
"""
GAINS, HIP = "actuator_gain[all]", "actuator_gain[hip]"
DAMPING, FRICTION = "joint_damping[FL_calf_joint]", "joint_friction[FL_calf_joint]"


@pytest.fixture
def problem(tmp_path):
    """A recording of an arm with a stronger hip motor and a calf that rubs."""
    robot = arm(tmp_path, MOTORS, of_motors(EFFECTS))
    told = mjcf_cases.commands(robot, np.random.default_rng(0), 3)
    planted = [
        effects.make("actuator_gain", {"part": "hip", "factor": 1.2}),
        effects.make("joint_friction", {"part": "FL_calf_joint", "added": 0.1}),
    ]
    return Problem.of(mjcf_cases.record(robot, told, planted), robot)


def test_a_gain_of_both_motors_is_one_of_one_with_nothing_to_undo_it(problem):
    start = descent.nothing(problem)
    both = refit.fitted_at(problem, start, {GAINS, DAMPING, FRICTION})
    assert both.support == {GAINS, DAMPING, FRICTION}
    one = simpler.parted(problem, both)
    assert HIP in one.support and GAINS not in one.support
    (hip,) = problem.terms[HIP]
    assert abs(one.values[hip] - 1.2) < 0.02


def test_friction_takes_the_place_of_a_damping_that_was_found_first(problem):
    start = descent.nothing(problem)
    wrong = refit.fitted_at(problem, start, {HIP, DAMPING})
    assert wrong.support == {HIP, DAMPING}
    found = starts._instead(Singles(problem, start), wrong)
    assert found.support == {HIP, FRICTION}
    (friction,) = problem.terms[FRICTION]
    assert abs(found.values[friction] - 0.1) < 0.01


def test_several_that_describe_a_wrong_start_give_way_to_a_single_one_with_another(
    problem,
):
    start = descent.nothing(problem)
    several = refit.fitted_at(problem, start, {GAINS, DAMPING, FRICTION})
    found = starts._from_others(Singles(problem, start), several)
    assert found.support == {HIP, FRICTION}


@pytest.mark.parametrize(("weak", "closing"), [(0.005, True), (0.02, False)])
def test_two_that_close_next_to_all_need_no_other_start(weak, closing):
    """Of three that depart, the weakest has so much of the gap."""
    parts = {"delay": 0.8, "load": 0.2 - weak, "friction": weak}

    def squares(names):
        return 1.0 + 1e4 * sum(parts[name] for name in parts if name not in names)

    linear = SimpleNamespace(squares=squares, free=tuple(parts))
    point = SimpleNamespace(linear=linear, support=frozenset(parts))
    problem = SimpleNamespace(model=SimpleNamespace(many=True))
    assert starts.enough(problem, point) == closing


SERVOED = """
name = "arm"
model = "robot.xml"
commands.hip = { actuator = "hip", unit = "rad", low = -0.6, high = 0.6 }
commands.calf = { actuator = "calf", unit = "rad", low = -0.6, high = 0.6 }
observed.q0 = { joint = "FL_hip_joint", unit = "rad", noise = 0.001 }
observed.q1 = { joint = "FL_calf_joint", unit = "rad", noise = 0.001 }
[effects]
actuator_kp = ["hip", "calf"]
actuator_kd = ["hip", "calf"]
body_mass = ["upper", "lower"]
"""


@pytest.fixture(scope="module")
def servoed(tmp_path_factory):
    """An arm of position servos, and what it is told."""
    robot = arm(tmp_path_factory.mktemp("servoed"), SERVOS, SERVOED)
    return robot, mjcf_cases.commands(robot, np.random.default_rng(0), 4)


@pytest.mark.parametrize(
    ("planted", "values", "name", "size"),
    [
        ("actuator_gain", {"part": "hip", "factor": 0.8}, HIP, 0.8),
        (
            "body_centre",
            {"part": "upper", "dx": 0.0, "dy": 0.03, "dz": 0.0},
            "body_centre.dy[upper]",
            0.03,
        ),
    ],
)
def test_a_weak_motor_and_a_shifted_centre_have_a_name_each(
    servoed, planted, values, name, size
):
    robot, told = servoed
    trials = mjcf_cases.record(robot, told, [effects.make(planted, values)])
    found = diagnose(trials, robot, full=False)
    assert found.verdict.named[0] == (name,)  # a load does what a shifted centre does
    assert found.best.magnitudes[0] == pytest.approx(size, rel=0.03)
