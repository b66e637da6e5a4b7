"""The model of feet that stay where they stand, against motions known in advance."""

import numpy as np
import pytest
import torch

from bns.errors import BnsError
from bns.experiment import robots
from bns.learners.bns import nominal
from bns.learners.bns.learner import Bns
from bns.learners.bns.walking import GOAL, MOVED
from bns.models.phantomx import gait, kinematics
from bns.snn.network import predict
from bns.snn.training import Patterns
from tests.bns.robots import Slider, small

STANDING = np.zeros((1, 18))
CROUCHED = gait.tripod(gait.Tripod(stride=0.02, height=0.12))[3:4]  # all feet down
FEET = kinematics.feet(CROUCHED)
TOUCHING = kinematics.contacts(CROUCHED)
LEFT = frozenset({0, 2, 4})


def moving(feet, *lost):
    accounts = lost or (nominal.NONE,)
    goals = kinematics.goals(feet)
    return nominal.moved(CROUCHED, goals, kinematics.contacts, accounts)[-1, 0]


def test_a_body_goes_against_the_feet_that_it_stands_on():
    ahead, left, turn = moving(FEET + np.array([-0.02, 0.01, 0.0]))
    assert (ahead, left, turn) == pytest.approx((0.02, -0.01, 0.0), abs=1e-3)


def test_a_body_turns_against_the_feet_that_it_stands_on():
    angle = 0.1
    around = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = np.concatenate([FEET[..., :2] @ around.T, FEET[..., 2:]], axis=-1)
    assert moving(turned) == pytest.approx((0.0, 0.0, -angle), abs=2e-3)


def test_feet_in_the_air_bear_nothing_and_the_rest_the_weight():
    touching = TOUCHING.copy()
    touching[:, np.flatnonzero(~gait.ONE_SET), 2] += 0.03
    load = nominal.loads(touching)[0, 0]
    assert load.sum() == pytest.approx(1.0)
    assert load[:6][gait.ONE_SET].min() > 0.2
    assert load[:6][~gait.ONE_SET].max() < 0.05
    assert load[6:].max() < 1e-6, "the belly is off the floor"


def test_lost_legs_bear_nothing_and_a_body_that_none_hold_lies_on_its_belly():
    one, side = nominal.loads(TOUCHING, (frozenset({4}), LEFT))[:, 0]
    assert one[4] == 0 and one[6:].max() < 1e-6
    assert [one.sum(), side.sum()] == pytest.approx([1.0, 1.0])
    assert side[list(LEFT)].max() == 0
    assert side[[6, 8]].sum() > 0.3, "the left corners"


def test_only_legs_that_bear_move_the_body():
    step = np.zeros((1, 6, 3))
    step[:, 4] = -0.02, 0.0, 0.0
    alone = moving(FEET + step, frozenset({4}))
    assert alone == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    step[:, :] = -0.02, 0.01, 0.0
    assert moving(FEET + step, nominal.NONE, frozenset({4})) == pytest.approx(
        (0.02, -0.01, 0.0), abs=1e-3
    )


def test_a_tripod_gait_goes_a_stride_every_other_command():
    goals = gait.tripod()
    before = np.concatenate([STANDING, goals[:-1]])
    ahead = nominal.moved(before, goals, kinematics.contacts)[0, 2:, 0]
    assert ahead[0::2] == pytest.approx(gait.BEST.stride, rel=0.25)
    assert np.abs(ahead[1::2]).max() < 0.2 * gait.BEST.stride


def test_the_network_says_what_the_model_says_and_is_the_same_each_time():
    reach = 0.6
    theta = nominal.network("phantomx", reach)
    before, after = nominal.drawn(np.random.default_rng(1), 500, reach)
    seen = np.concatenate([before, after], axis=1) / GOAL
    said = nominal.said(theta, nominal._tensor(seen))[0].numpy().T * np.array(MOVED)
    told = nominal.moved(before, after, kinematics.contacts)[0]
    rest = ((said - told) ** 2).sum(0) / ((told - told.mean(0)) ** 2).sum(0)
    assert (rest < 0.4).all()
    again = nominal.network.__wrapped__("phantomx", reach)
    torch.testing.assert_close(again, theta, rtol=0, atol=0)


def learner(**walk):
    config = small()
    changed = config.with_({f"walk.{name}": value for name, value in walk.items()})
    return Bns([changed], replicates=[0], onsets=[-1])


def test_a_fresh_learner_foresees_what_the_model_says_and_learns_the_rest():
    one = learner(nominal=True)
    tried = one.propose(0).tried
    trials = Slider().run(tried)
    memory, problem = one.memories[0], one.problem
    memory.theta = torch.zeros_like(memory.theta)
    goals = tried[0].values
    before = np.concatenate([STANDING, goals[:-1]])
    seen = np.concatenate([before, goals], axis=1) / GOAL
    model = problem.evaluator.nominal
    own = nominal.said(model.theta, nominal._tensor(seen))[0].numpy().T
    own = own * np.array(MOVED)
    _, moved = problem.inputs_and_motion(trials[0])
    (patterns,) = problem.patterns(0, trials[0])
    error = problem.error(0, trials[0], one.memories, patterns)
    assert error == pytest.approx(np.sqrt(((own - moved) ** 2).mean(0)), rel=1e-4)
    memory.theta = memory.fresh()
    for _ in range(20):
        one.observe(0, trials, None)
    assert problem.error(0, trials[0], one.memories, patterns)[0] < error[0] / 2


HELD = nominal.GIVEN / (nominal.GIVEN + 40)  # of the model's right in 40 patterns


@pytest.mark.parametrize(
    "share,trust", [(0.4, HELD + (1 - HELD) * 0.4), (-9.0, 0.0), (3.0, 1.0)]
)
def test_the_model_is_trusted_as_far_as_patterns_bear_it_out(share, trust):
    model = learner(nominal=True).problem.evaluator.nominal
    before, after = nominal.drawn(np.random.default_rng(1), 50, 0.6)
    seen = nominal._tensor(np.concatenate([before, after], axis=1) / GOAL)
    told = nominal.said(model.theta, seen)
    weight = torch.ones(1, 1, 1, 50)
    weight[..., 40:] = 0.0  # padding
    targets = told * share
    targets[..., 40:] = 99.0
    found = model.weigh(Patterns(seen, targets, weight))
    assert model.trust.flatten().tolist() == pytest.approx([trust] * 3, abs=1e-5)
    torch.testing.assert_close(found, told * trust)
    model.weigh(Patterns(seen, targets, torch.zeros_like(weight)))
    assert model.trust.flatten().tolist() == [1.0] * 3, "nothing speaks against it"


def test_anchors_are_motions_in_which_the_model_leaves_nothing():
    config = small().with_({"walk.nominal": True, "walk.coxa_reach": 0.9})
    model = nominal.Nominal(config, 2)
    model.without(1, frozenset({4}))
    inputs, targets = torch.ones(2, 36, 12), torch.full((2, 3, 12), 9.0)
    weight = torch.zeros(2, 1, 1, 12)
    weight[0, ..., :10], weight[1, ..., :4] = 1.0, 1.0
    given = Patterns(inputs, targets, weight)
    found = model.anchored(given, 0.5, np.random.default_rng(0))
    assert found.inputs.shape == (2, 36, 15)
    assert found.weight.sum((1, 2, 3)).tolist() == [15, 6]
    assert weight.sum() == 14 and (inputs == 1).all() and (targets == 9).all()
    for run, count, more in ((0, 10, 5), (1, 4, 2)):
        assert (found.targets[run, :, :count] == 9).all()
        added = slice(count, count + more)
        assert (found.targets[run, :, added] == 0).all()
        assert found.inputs[run, :, added].std(1).gt(0).sum() >= 30
    angles = found.inputs[0, :, 10:].view(2, 6, 3, 5) * GOAL
    assert angles[:, :, 0].abs().max() > 0.6 >= angles[:, :, 1:].abs().max()
    assert (found.inputs[1, :, 4:6].view(2, 6, 3, 2)[:, 4] == 0).all()
    with pytest.raises(BnsError, match=r"walk\.nominal"):
        learner(anchors=0.5)


def test_a_pattern_pulls_no_farther_than_it_is_told():
    shown = {}
    for pull in (0.0, 0.1):
        one = learner(pull=pull)
        problem, memory = one.problem, one.memories[0]
        drawn = torch.randn(1, 36, 8, generator=torch.Generator().manual_seed(0))
        far = Patterns(drawn, torch.full((1, 3, 8), 50.0), torch.ones(1, 1, 1, 8))
        before = predict(memory.shape, memory.theta, drawn)
        theta, _ = problem.train(memory.shape, memory.theta, far)
        moved = predict(memory.shape, theta, drawn) - before
        shown[pull] = float(moved.abs().max())
    assert shown[0.1] < 0.5 < shown[0.0]


def test_robots_whose_legs_are_not_known_are_refused():
    with pytest.raises(BnsError, match="not those of 'other'"):
        robots.contacts("other")


LOST = {"walk.nominal": True, "walk.lost_legs": True, "watch.forget": True}


def advance(one, number):
    seen = Slider().run(one.propose(number).tried)
    return one.observe(number, seen, None)


def test_a_robot_with_lost_legs_is_told_by_its_motion_and_resumes_so():
    config = small().with_(LOST)
    first, second = (Bns([config], replicates=[0], onsets=[-1]) for _ in range(2))
    gone = frozenset({1, 4})
    first.problem.nominal.without(0, gone)
    model = first.problem.nominal
    assert model.moving[0].flatten().reshape(2, 6, 3).sum((0, 2)).tolist() == [
        6, 0, 6, 6, 0, 6
    ]  # fmt: skip
    for number in range(3):
        advance(first, number)
    second.restore(first.state())
    assert second.problem.nominal.lost == first.problem.nominal.lost
    wanted, found = advance(first, 3), advance(second, 3)
    for name in wanted:
        np.testing.assert_array_equal(found[name], wanted[name])


def test_goals_of_lost_legs_change_nothing_that_is_foreseen():
    one = Bns([small().with_(LOST)], replicates=[0], onsets=[-1])
    one.problem.nominal.without(0, frozenset({4}))
    memory, population = one.memories[0], one.population
    before = one.problem.evaluator.cost(memory.theta, population)
    population.genes[..., 12:15] += 0.1
    after = one.problem.evaluator.cost(memory.theta, population)
    torch.testing.assert_close(after, before, rtol=0, atol=0)


@pytest.mark.parametrize("missing", ["walk.nominal", "watch.forget"])
def test_lost_legs_need_a_model_and_forgetting(missing):
    config = small().with_(LOST | {missing: False})
    with pytest.raises(BnsError, match=missing):
        Bns([config], replicates=[0], onsets=[-1])


def test_resumed_with_the_model_it_gives_the_same_bytes():
    first, second = learner(nominal=True, repeat=0.1), learner(nominal=True, repeat=0.1)
    for number in range(6):
        advance(first, number)
    second.restore(first.state())
    wanted, found = advance(first, 6), advance(second, 6)
    for name in wanted:
        np.testing.assert_array_equal(found[name], wanted[name])


def test_the_reach_of_coxae_grows_from_trial_to_trial():
    problem = learner(coxa_reach=0.9, grow_from=10, grow_until=40).problem
    for trial, farthest in ((0, 0.6), (10, 0.6), (25, 0.75), (39, 0.89)):
        reach = problem.rates(trial).reach
        assert reach is not None
        assert reach.view(6, 3).amax(0).tolist() == pytest.approx([farthest, 0.6, 0.6])
    assert problem.rates(40).reach is None
    assert learner().problem.rates(0).reach is None
