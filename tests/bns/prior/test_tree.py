"""Tree search on problems whose best action is known."""

from dataclasses import replace

import numpy as np
import pytest

from bns.prior import driving

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
