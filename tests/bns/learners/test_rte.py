"""RTE on wheels whose damage is planted, and tree search where the best is known."""

from dataclasses import replace

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError
from bns.experiment.batch import Batch
from bns.experiment.loading import with_learner
from bns.prior import driving
from bns.worlds.world import CountedWorld
from tests.bns.robots import wheels

SLOW = "wheel_gain:wheel=left,factor=0.8"
QUICK = {"iterations": 200, "evaluations": 40}


def batch(onset, *, model=True, most=4000, **own):
    """Runs in the kinematic world, the left wheel slower from a trial on."""
    damage = [f"{SLOW}@{onset}"]
    base = replace(presets.load("khepera-simple"), replicates=2, threads=1)
    told = {f"settings.{name}": value for name, value in (QUICK | own).items()}
    config = with_learner(base, "rte").with_({**told, "world.damage": damage})
    models = [CountedWorld(wheels(), most) for _ in range(2)] if model else []
    return Batch([config], [wheels(damage)], models=models)


def rows(made, trials):
    steps = [made.advance(trial)[0].columns for trial in range(trials)]
    return {name: np.stack([step[name] for step in steps]) for name in steps[0]}


def test_it_solves_the_task_at_once_and_again_after_damage():
    made = batch(2)
    found = rows(made, 8)
    assert (found["solved"][:2] == 1).all() and (found["solved"][2] == 0).all()
    assert (found["solved"][-1] == 1).all() and (found["solved_best"][-1] == 1).all()
    assert found["behaviour_miss"][-1].max() < 0.1 * found["behaviour_miss"][2].min()
    assert [model.spent for model in made.learner.models] == [40, 40]


def test_without_the_process_it_does_not():
    found = rows(batch(2, learning=False), 8)
    assert (found["solved"][:2] == 1).all() and (found["solved"][2:] == 0).all()


def test_without_a_model_its_repertoire_is_what_was_driven():
    found = rows(batch(7, model=False, explored=6), 13)
    assert (found["repertoire"][:6, 0] == 18 * np.arange(1, 7)).all()
    assert np.isnan(found["behaviour_miss"][:6]).all()
    assert (found["solved"][6] == 1).all() and (found["solved"][-1] == 1).all()


def test_nobody_tells_and_it_sees_for_itself():
    made = batch(2, told="never")
    found = rows(made, 8)
    assert (found["solved"][-1] == 1).all()
    assert all((memory.trial >= 2).all() for memory in made.learner.memories)


def test_the_process_finds_what_a_planted_wheel_gain_does_to_behaviours_not_driven():
    made = batch(0)
    made.advance(0)
    made.advance(1)
    learner, memory = made.learner, made.learner.memories[0]
    lists = learner.controllers([genes[None] for genes in memory.genes])
    true, _ = driving.displacements(wheels([SLOW]).run(lists), learner.each)
    mean, spread = learner.expected(memory)
    others = np.setdiff1d(np.arange(len(mean)), memory.at)
    off = [
        np.linalg.norm(guess - driving.targets(true), axis=1)[others].mean()
        for guess in (mean, driving.targets(memory.moved))
    ]
    assert len(others) > 50 and off[0] < 0.5 * off[1]
    assert spread[memory.at].max() < spread[others].mean()


def test_each_behaviour_ends_at_rest_and_lists_are_no_longer_than_allowed():
    made = batch(9)
    learner = made.learner
    genes = learner.random(1, np.random.default_rng(0))[0]
    (commands,) = learner.controllers([genes])
    assert len(commands) == 36 and (commands.values[1::2] == 0).all()
    np.testing.assert_allclose(commands.durations[::2], genes[:, 2], rtol=1e-6)


def test_no_more_is_spent_than_there_is():
    made = batch(9, most=7)
    made.advance(0)
    assert made.learner.models[0].spent == 7


def test_displacements_compose_to_where_the_robot_is_seen():
    world = wheels()
    learner = batch(9).learner
    genes = list(learner.random(3, np.random.default_rng(1)))
    trials = world.run(learner.controllers(genes))
    moved, good = driving.displacements(trials, learner.each)
    assert good.all() and moved.shape == (3 * 18, 3)
    pose = tuple(trials[0].command_poses_world[0])
    for x, y, turn in moved[:18]:
        pose = driving.moved_by(pose, x, y, turn)
    np.testing.assert_allclose(pose, trials[0].command_poses_world[-1], atol=1e-9)


def test_what_was_not_seen_or_not_left_alone_is_not_learned_from():
    trial = wheels().run(batch(9).learner.controllers([np.full((3, 3), 0.1)]))[0]
    poses = trial.observed.copy()
    poses[trial.boundaries[2]] = np.nan
    _, good = driving.displacements([trial.replace(observed=poses)], 2)
    assert good.tolist() == [False, False, True]
    handled = np.array([False, False, False, False, True, False])
    _, good = driving.displacements([trial.replace(handled=handled)], 2)
    assert good.tolist() == [True, True, False]


@pytest.mark.parametrize("task", ["park", "walk"])
def test_a_task_without_objectives_in_order_is_refused(task):
    preset = "hexapod-walk" if task == "walk" else "khepera-simple"
    config = with_learner(presets.load(preset), "rte").with_({"task.name": task})
    with pytest.raises(BnsError, match="knows tasks of the kind navigation"):
        Batch([config], [wheels()])


RULE = driving.Rule(iterations=1500, bonus=1.0)


class Line:
    """Steps along a line: 3 is worth 1, but behind -1 there is 2, after two steps."""

    def proposed(self, state, rng):
        return int(rng.choice([-1, 1]))

    def outcome(self, state, action, rng):
        after = state + action
        reward = {3: 1.0, -2: 2.0}.get(after, 0.0)
        return after, reward, bool(reward)

    def rollout(self, state, rng):
        weight = 1.0
        for _ in range(4):
            state, reward, over = self.outcome(state, self.proposed(state, rng), rng)
            if over:
                return weight * reward
            weight *= RULE.discount
        return 0.0


class Gamble:
    """One step; action a is worth 1 - (a - 0.7)^2 on average, the more noisy the less
    it is; actions are all numbers from 0 to 1."""

    def proposed(self, state, rng):
        return float(rng.random())

    def outcome(self, state, action, rng):
        noise = 0.5 * (1 - action) * rng.standard_normal()
        return state + 1, 1 - 4 * (action - 0.7) ** 2 + noise, True

    def rollout(self, state, rng):
        raise AssertionError("it is over after one step")


def test_the_larger_reward_is_found_and_what_it_is_worth():
    action, worth = driving.best(Line(), 0, RULE, np.random.default_rng(0))
    assert action == -1
    assert worth == pytest.approx(0.9 * 2, abs=0.35)
    far, _ = driving.best(Line(), 2, RULE, np.random.default_rng(0))
    assert far == 1


def test_the_best_of_infinitely_many_noisy_actions_is_found():
    rng = np.random.default_rng
    found = [driving.best(Gamble(), 0, RULE, rng(seed))[0] for seed in range(9)]
    assert abs(np.median(found) - 0.7) < 0.1


def test_the_same_seed_gives_the_same():
    rng = np.random.default_rng
    one, again = (driving.best(Gamble(), 0, RULE, rng(3)) for _ in range(2))
    assert one == again != driving.best(Gamble(), 0, RULE, rng(4))


@pytest.mark.parametrize("exponent", [0.3, 0.5])
def test_actions_widen_with_the_power_of_the_visits(exponent):
    asked = []

    class Counted(Gamble):
        def proposed(self, state, rng):
            asked.append(state)
            return super().proposed(state, rng)

    rule = replace(RULE, actions=exponent, iterations=400)
    driving.best(Counted(), 0, rule, np.random.default_rng(0))
    assert len(asked) == pytest.approx(400**exponent, abs=2)
