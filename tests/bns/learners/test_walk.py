"""Walking: fitness, path, patterns, bounds, training, the loop in a quick world."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from bns import presets
from bns.draws import Draws
from bns.errors import BnsError
from bns.evolution.chromosome import Population
from bns.evolution.goals import TICK, Goals
from bns.experiment.config import RunConfig
from bns.experiment.run import train
from bns.learners.bns import change_detection as forgetting
from bns.learners.bns import walking
from bns.learners.bns.config import WatchConfig
from bns.learners.bns.learner import Bns
from bns.learners.bns.memory import PatternBuffer
from bns.learners.bns.problem import should_compile
from bns.learners.bns.walking import WalkEvaluator, path, variance
from bns.snn import training
from bns.snn.network import Shape, forward
from bns.snn.training import Patterns
from bns.tasks import walk as task
from bns.tasks.walk import WalkTask
from bns.worlds.trial import Commands, Outcome, Trial
from tests.bns.robots import STRIDE, Slider, small

SHAPE = Shape(groups=3, hidden=8, outputs=3, inputs=36, activation="relu")


def moved(*steps):
    """Scaled outputs ``(1, 1, 3, K)`` of one member and one individual."""
    scaled = np.array(steps) / np.array(walking.MOVED)
    return torch.tensor(scaled.T, dtype=torch.float32)[None, None]


class TestFitness:
    def test_printed_is_variance_over_distance(self):
        cost = walking.printed(torch.tensor([[0.5, 2.0]]), torch.tensor([[1.0, 1.0]]))
        assert cost.tolist() == [[2.0, 0.5]]

    def test_printed_cannot_tell_far_from_near_where_all_agree(self):
        cost = walking.printed(torch.tensor([[0.01, 1.0]]), torch.zeros(1, 2))
        assert cost.tolist() == [[0.0, 0.0]]

    def test_repaired_is_distance_less_the_spread_of_end_points(self):
        x = torch.tensor([[[3.0], [5.0]]])  # two members: mean 4, spread 1
        y = torch.tensor([[[3.0], [3.0]]])
        assert walking.repaired(x, y, 2.0).item() == pytest.approx(2 - 5)

    def test_standing_still_is_no_optimum_of_the_repaired_form(self):
        still = walking.repaired(torch.zeros(1, 4, 1), torch.zeros(1, 4, 1), 1.0)
        x = torch.tensor([[[0.02], [0.03], [0.02], [0.03]]])
        moving = walking.repaired(x, torch.zeros(1, 4, 1), 1.0)
        assert moving.item() < still.item() == 0.0
        agreed = walking.printed(torch.tensor([[1e-3]]), torch.tensor([[1e-9]]))
        assert agreed.item() < walking.printed(
            torch.tensor([[0.025]]), torch.tensor([[1e-3]])
        ), "the printed form prefers not to move"


class TestEvaluator:
    def test_a_square_ends_where_it_began(self):
        outputs = moved(*[(0.05, 0.0, math.pi / 2)] * 4)
        x, y, yaw = path(outputs, 1)
        np.testing.assert_allclose(x[0, 0, :, 0], [0.05, 0.05, 0, 0], atol=1e-7)
        np.testing.assert_allclose(y[0, 0, :, 0], [0, 0.05, 0.05, 0], atol=1e-7)
        assert yaw[0, 0, -1, 0].item() == pytest.approx(2 * math.pi)

    def test_variance_sums_outputs_and_commands_of_each_individual(self):
        one, two = torch.zeros(1, 1, 3, 4), torch.zeros(1, 1, 3, 4)
        two[..., 0], two[..., 2] = 2.0, 4.0  # commands 0 and 1 of individual 0
        found = variance(torch.cat([one, two], 1), 2)
        assert found.tolist() == [[3 * 1.0 + 3 * 4.0, 0.0]]

    def test_pieces_give_what_the_whole_gives(self, monkeypatch):
        monkeypatch.setattr("bns.learners.bns.walking.CHUNK", 7)
        draws = Draws(1)
        theta, seen = SHAPE.random(2, draws), draws.uniform(2, 36, 30)
        evaluator = WalkEvaluator(SHAPE, small().walk)
        whole = forward(SHAPE, theta, seen)
        torch.testing.assert_close(evaluator.members(theta, seen), whole)

    def test_inputs_are_the_goals_before_and_the_goals(self):
        goals = torch.arange(6.0).view(1, 1, 2, 3)
        wanted = torch.tensor([[0.0, 0, 0, 0, 1, 2], [0, 1, 2, 3, 4, 5]])
        found = walking.goal_inputs(goals)[0, 0]
        torch.testing.assert_close(found, wanted / walking.GOAL)

    def test_each_individual_gets_its_own_path(self):
        config = small()
        goals, draws = Goals.of(config), Draws(3)
        theta = SHAPE.random(1, draws)
        evaluator = WalkEvaluator(SHAPE, config.walk)
        both = goals.random(1, 2, draws)
        alone = Population(both.genes[:, 1:], both.lengths[:, 1:])
        torch.testing.assert_close(
            evaluator.cost(theta, both)[:, 1:], evaluator.cost(theta, alone)
        )
        torch.testing.assert_close(
            evaluator.poses(theta, both)[:, 1:], evaluator.poses(theta, alone)
        )


class TestTraining:
    def test_a_step_is_that_of_torch(self):
        draws = Draws(0)
        theta = draws.uniform(2, 5)
        weight = torch.nn.Parameter(theta.clone())
        optimiser = torch.optim.Adam([weight], lr=0.01)
        state = training.AdamState.fresh(theta)
        for step in range(1, 4):
            grad = draws.uniform(2, 5) - 0.5
            weight.grad = grad.clone()
            optimiser.step()
            theta, state = training.adam(
                theta, grad, state, torch.tensor(0.01), torch.tensor(float(step))
            )
        torch.testing.assert_close(theta, weight.data)

    def test_it_learns_and_runs_do_not_mix(self):
        config, draws = small(), Draws(0)
        inputs = draws.uniform(2, 36, 64) - 0.5
        targets = torch.stack([inputs[:, 0], -inputs[:, 1], inputs[:, :9].sum(1)], 1)
        weight = torch.ones(2, 1, 1, 64)
        weight[1, ..., 40:] = 0.0
        inputs[1, :, 40:], targets[1, :, 40:] = 99.0, -99.0  # padding
        theta = SHAPE.random(2, draws)
        patterns = Patterns(inputs, targets, weight)
        config = replace(config, snn=replace(config.snn, epochs=400, dropout=0.0))
        _, loss = training.fit_adam(SHAPE, config, theta, patterns, draws)
        assert (loss < 0.1 * targets[0].square().mean()).all()

    def test_few_patterns_are_learned_in_few_steps(self):
        config, draws = small(), Draws(0)
        inputs, targets = draws.uniform(2, 36, 64) - 0.5, draws.uniform(2, 3, 64)
        weight = torch.ones(2, 1, 1, 64)
        weight[0, ..., 8:] = 0.0
        theta = SHAPE.random(2, draws)
        patterns = Patterns(inputs, targets, weight)

        def fit(**settings):
            changed = config.with_(settings | {"walk.batch": 16, "snn.dropout": 0.0})
            found, _ = training.fit_adam(SHAPE, changed, theta, patterns, Draws(1))
            return found

        once = fit(**{"snn.epochs": 1})
        twice = fit(**{"walk.passes": 2.0})  # 8 patterns are a step, 64 are eight
        torch.testing.assert_close(twice[0], once[0], rtol=0, atol=0)
        assert not torch.isclose(twice[1], once[1]).any()

    def test_slope_of_relu_is_that_of_autograd(self):
        from bns.snn.training import gradient

        draws = Draws(2)
        theta = SHAPE.random(1, draws).requires_grad_()
        inputs, targets = draws.uniform(1, 36, 9) - 0.5, draws.uniform(1, 1, 3, 9)
        weight = torch.ones(1, 1, 1, 9)
        w1, b1, w2, b2 = SHAPE.split(theta)
        hidden = (w1 @ inputs + b1).relu().view(1, 3, 8, 9)
        error = w2 @ hidden + b2 - targets
        (error.square().sum() / 2).backward()
        found = gradient(SHAPE, theta.detach(), inputs, targets, weight)
        torch.testing.assert_close(found, theta.grad)


def told(count=3):
    channels = Goals.of(small()).channels
    return Commands(np.zeros((count, 18)), np.ones(count), channels)


def trial(poses, **flags):
    count = len(poses)
    return Trial(
        told(count - 1),
        np.arange(count),
        np.array(poses, float),
        np.arange(count),
        outcome=Outcome(**flags),
    )


class TestObserving:
    STRAIGHT = ((0, 0, 0), (0.1, 0, 0), (0.2, 0, 0), (0.3, 0.4, 0))

    def test_distance_is_from_start_to_end(self):
        assert task.of_trials([trial(self.STRAIGHT)]) == pytest.approx([0.5])

    def test_a_lost_end_is_where_it_was_seen_last(self):
        lost = trial((*self.STRAIGHT[:3], (np.nan,) * 3))
        assert task.of_trials([lost]) == pytest.approx([0.2])

    def test_fitness_is_equation_7_4_in_centimetres_turned_round(self):
        config = replace(small(), walk=replace(small().walk, adequate=0.5))
        row = WalkTask(config).measured([trial(self.STRAIGHT)])
        assert row["fitness"] == pytest.approx([-2500.0])
        assert row["solved"] == [1.0]

    @pytest.mark.parametrize(
        "flags,solved,way",
        [({"fell": True}, 0.0, 0.5), ({"diverged": True}, 0.0, 0.0)],
    )
    def test_who_fell_or_diverged_has_not_solved(self, flags, solved, way):
        walk = replace(small().walk, adequate=0.4, upright=True)
        made = WalkTask(replace(small(), walk=walk))
        row = made.measured([trial(self.STRAIGHT, **flags)])
        assert row["solved"] == [solved]
        assert row["distance"] == pytest.approx([way])

    def test_patterns_are_in_the_body_frame_and_leave_the_lost_out(self):
        turned = trial(((0, 0, math.pi / 2), (0, 0.1, math.pi / 2), (np.nan,) * 3))
        seen, was = walking.of_trial(turned)
        assert seen.shape == (1, 36)
        np.testing.assert_allclose(was, [[0.1, 0, 0]], atol=1e-12)


class TestLearner:
    def test_it_walks_farther_than_it_began(self):
        record = train(small(trials=14), world=Slider())
        before, after = record["distance"][:, :5], record["distance"][:, -4:]
        assert (np.ptp(before, axis=1) > 0).all(), "random controllers, not one"
        assert (after.mean(1) > 1.3 * before.mean(1)).all()
        assert (record["distance"] <= STRIDE * 3 * 11).all()
        error = np.abs(record["distance_predicted"] - record["distance"])
        assert error[:, -1].max() < 0.1

    def test_first_trials_are_random_controllers(self):
        record = train(small(trials=6), world=Slider())
        within = np.abs(record.sent).max((2, 3)) <= 0.4 + 1e-6
        assert within[:, :5].all() and not within[:, 5].any()

    def test_resumed_state_gives_the_same_bytes(self):
        def learner():
            return Bns([small()] * 2, replicates=[0, 1], onsets=[-1, -1])

        def advance(one, number):
            seen = Slider().run(one.propose(number).tried)
            return one.observe(number, seen, None)

        first, second = learner(), learner()
        for number in range(6):
            advance(first, number)
        second.restore(first.state())
        wanted, found = advance(first, 6), advance(second, 6)
        assert set(wanted) == set(found)
        for name in wanted:
            np.testing.assert_array_equal(found[name], wanted[name])

    def test_mutation_after_damage_is_in_ticks(self):
        config = small()
        config = replace(
            config, adaptation=replace(config.adaptation, mutation_magnitude_after=40.0)
        )
        one = Bns([config], replicates=[0], onsets=[3])
        before, after = one.problem.rates(3).magnitude, one.problem.rates(4).magnitude
        assert before[0].tolist() == pytest.approx([20 * TICK] * 18)
        assert after[0].tolist() == pytest.approx([40 * TICK] * 18)

    def test_a_robot_without_legs_is_refused(self):
        config = small()
        wheels = replace(config, world=replace(config.world, robot="khepera3"))
        with pytest.raises(BnsError, match="is wheeled and cannot walk"):
            Bns([wheels], replicates=[0], onsets=[-1])

    def test_all_that_is_wrong_is_said_at_once(self):
        wheels = RunConfig().with_({"task.name": "walk"})
        with pytest.raises(BnsError) as error:
            Bns([wheels], replicates=[0], onsets=[-1])
        give = "--world.robot phantomx --world.name hexapod --snn.kind ensemble"
        for said in ("robot with legs", "snn.kind = 'three'", "hexapod-walk", give):
            assert said in str(error.value)

    def test_networks_that_cannot_disagree_are_refused(self):
        config = small()
        three = replace(config, snn=replace(config.snn, kind="three"))
        with pytest.raises(BnsError, match=r"give --snn\.kind ensemble\."):
            Bns([three], replicates=[0], onsets=[-1])

    @pytest.mark.parametrize("form", ["printed", "repaired"])
    def test_both_forms_of_fitness_run(self, form):
        config = small(trials=7)
        config = replace(config, walk=replace(config.walk, fitness=form))
        record = train(config, world=Slider())
        assert np.isfinite(record["worth_predicted"]).all()


def test_generations_are_not_compiled():
    """Compiled ones take several times as long: see `WalkProblem`."""
    long = replace(presets.load("hexapod-walk"), trials=10**6, compiled="auto")
    assert not should_compile(long, walking.WalkProblem.relative_cost)


SIZE = 11


def walks(trials, *, change=None, seed=0, noise=0.2):
    """Patterns of walks that wander, on which half of the robot's law turns round."""
    rng = np.random.default_rng(seed)
    law = rng.normal(size=(36, 3)) / 2
    gait = rng.normal(size=(SIZE, 36))
    seen = np.array(
        [gait := gait + rng.normal(0, 0.1, gait.shape) for _ in range(trials)]
    )
    told = np.tanh(seen @ law) * 2
    if change is not None:
        law[:18] *= -1
        told[change:] = np.tanh(seen[change:] @ law) * 2
    told += rng.normal(0, noise, told.shape)
    return seen.reshape(-1, 36), told.reshape(-1, 3)


@pytest.mark.parametrize("seed", range(4))
def test_the_trials_since_a_change_are_found_to_the_trial(seed):
    seen, told = walks(20, change=17, seed=seed)
    assert forgetting.changed(seen, told, SIZE) == 3 * SIZE


@pytest.mark.parametrize("seed", range(4))
def test_noise_and_wandering_are_no_change(seed):
    seen, told = walks(27, seed=seed, noise=0.6)
    assert forgetting.changed(seen, told, SIZE) == 0


def test_ground_that_was_never_walked_is_no_change():
    seen, told = walks(20)
    seen[-3 * SIZE :] += 5.0  # far from everything
    told[-3 * SIZE :] *= -1.0
    assert forgetting.changed(seen, told, SIZE) == 0


@pytest.mark.parametrize("back", [1, 2, 3])
def test_one_odd_trial_is_no_change_however_odd(back):
    seen, told = walks(20)
    odd = slice(len(told) - back * SIZE, len(told) - (back - 1) * SIZE)
    told[odd] = -20.0
    assert forgetting.changed(seen, told, SIZE) == 0


def test_few_old_trials_are_no_ground_to_judge_from():
    least = forgetting.OLD + min(forgetting.NEW)
    seen, told = walks(least, change=forgetting.OLD)
    assert forgetting.changed(seen, told, SIZE) == 2 * SIZE
    assert forgetting.changed(seen[SIZE:], told[SIZE:], SIZE) == 0


def test_the_probability_is_that_of_the_normal_distribution():
    from scipy.stats import multivariate_normal

    seen, told = walks(2)
    like, scale = forgetting.covariance(seen), np.array([1.0, 4.0, 9.0])
    wanted = sum(
        multivariate_normal.logpdf(told[:, axis], cov=like * scale[axis])
        for axis in range(3)
    )
    constant = 3 * len(told) * np.log(2 * np.pi) / 2  # the same under both accounts
    found = forgetting.foretold(like, told, scale).sum()
    assert found - constant == pytest.approx(wanted)


def test_a_buffer_keeps_its_newest():
    buffer = PatternBuffer(2, [0, 0], (1, 1))
    for run in range(2):
        buffer.append(run, np.arange(5.0)[:, None], np.arange(5.0)[:, None])
    buffer.keep(0, 2)
    buffer.keep(1, 9)
    assert buffer.inputs[0].ravel().tolist() == buffer.targets[0].ravel().tolist()
    assert buffer.inputs[0].ravel().tolist() == [3.0, 4.0]
    assert buffer.counts.tolist() == [2, 5]


class Turned(Slider):
    """From trial 14 on the same commands move the body the other way."""

    def run(self, commands, *, trial=0, seeds=()):
        trials = super().run(commands, trial=trial, seeds=seeds)
        way = -1 if trial >= 14 else 1
        return [replace(t, observed=t.observed * [way, 1, 1]) for t in trials]


def test_a_learner_drops_what_came_before_the_change():
    quiet = replace(small().world, damage=())
    config = small(trials=17, watch=WatchConfig(forget=True), world=quiet)
    record = train(config, world=Turned())
    counts = record["patterns"].astype(int)
    assert (counts[:, :14] == SIZE * np.arange(1, 15)).all(), "no false alarm"
    assert (counts[:, 16] == 3 * SIZE).all(), counts
    usual = train(replace(config, watch=WatchConfig()), world=Turned())
    assert (usual["patterns"][:, 16] == 17 * SIZE).all()
