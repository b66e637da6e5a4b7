"""Damage detection and forgetting by evidence, on data whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from bns.experiment.config import WorldConfig
from bns.learners.bns.change_detection import Detector, Ground, Misses, innovation
from bns.learners.bns.config import AdaptationConfig, SnnConfig, WatchConfig
from bns.learners.bns.forgetting import contradicted
from bns.learners.bns.learner import Bns
from bns.learners.bns.light.simulator import CHANNELS
from bns.learners.bns.navigation import WheeledProblem, ways
from bns.snn.network import AXLE
from bns.tasks.light_controller import GenomePolicy
from tests.bns.learners.test_learner import SMALL, batch, play
from tests.bns.robots import FakeLightWorld, small_light

WATCH = WatchConfig()


class TestInnovation:
    def judged(self, miss, *, usual=0.3, doubt=0.0, learned=0.0, far=0.0, unit=1.0):
        """Innovation of patterns that all lie `far` from the same learned ones."""
        miss = np.asarray(miss, float).reshape(len(miss), -1)
        count, channels = miss.shape
        near = np.tile(np.arange(WATCH.near), (count, 1))
        ground = Ground(np.ones(count, bool), near, np.full(count, far))
        misses = Misses(
            miss,
            np.full(miss.shape, doubt),
            np.full((WATCH.near, channels), learned),
            np.full(channels, usual),
        )
        return innovation(misses, ground, WATCH, unit=unit)

    def test_misses_as_large_as_expected_give_one(self):
        got = self.judged([[0.3, -0.3], [-0.3, 0.3]] * 3)
        np.testing.assert_allclose(got, [1.0, 1.0], rtol=0.02)

    def test_disagreement_excuses_a_miss(self):
        got = self.judged([0.5] * 6, doubt=0.16)
        np.testing.assert_allclose(got, 1.0, rtol=0.02)

    def test_what_the_floor_is_hides_smaller_misses(self):
        got = self.judged([0.06] * 6, usual=0.0, unit=2.0)
        np.testing.assert_allclose(got, 1.0)

    def test_where_an_snn_always_erred_a_miss_is_no_news(self):
        miss = [0.3] * 6
        assert self.judged(miss, usual=0.05, learned=0.3) < 1.0
        assert self.judged(miss, usual=0.05, learned=0.01) > 20.0

    def test_far_from_what_was_learned_more_is_expected(self):
        far, miss = 0.4, [WATCH.grow * 0.4] * 6
        got = self.judged(miss, usual=0.0, far=far)
        share = 1 / (1 + (WATCH.floor / (WATCH.grow * far)) ** 2)
        np.testing.assert_allclose(got, share)

    def test_a_few_patterns_that_stand_out_are_enough(self):
        usual = np.hypot(0.3, WATCH.floor)
        got = self.judged([4 * usual] * WATCH.largest + [0.0] * 95)
        np.testing.assert_allclose(got, 16.0)
        got = self.judged([4 * usual] + [0.0] * 99)
        np.testing.assert_allclose(got, 16.0 / WATCH.largest)

    def test_patterns_on_new_ground_do_not_count(self):
        near = np.zeros((6, WATCH.near), int)
        ground = Ground(np.array([True] * 5 + [False]), near, np.zeros(6))
        miss = np.array([[0.3]] * 5 + [[9.0]])
        none = np.zeros((1, 1))
        misses = Misses(miss, np.zeros((6, 1)), none, np.array([0.3]))
        np.testing.assert_allclose(innovation(misses, ground, WATCH), 1.0, rtol=0.02)

    def test_with_too_few_patterns_nothing_is_said(self):
        known = np.array([True] * (WATCH.near - 1) + [False] * 3)
        many = len(known)
        ground = Ground(known, np.zeros((many, WATCH.near), int), np.zeros(many))
        ones = np.ones((many, 1))
        misses = Misses(ones, ones, ones, np.ones(1))
        assert np.isnan(innovation(misses, ground, WATCH)).all()

    def test_ground_says_what_is_near_and_how_far(self):
        learned = np.array([[0.0, 0.1 * k] for k in range(WATCH.near)] + [[9.0, 9.0]])
        asked = np.array([[0.9 * WATCH.reach, 0.0], [-1.2 * WATCH.reach, 0.0]])
        got = Ground.of(asked, learned, WATCH)
        assert got.known.tolist() == [True, False]
        assert sorted(got.nearest[0]) == [*range(WATCH.near)]
        last = 0.1 * (WATCH.near - 1)
        np.testing.assert_allclose(got.far[0], np.hypot(0.9 * WATCH.reach, last))
        assert not Ground.of(asked, learned[: WATCH.near - 1], WATCH).known.any()


class TestDetector:
    def noise(self, trials, runs=20, seed=1):
        rng = np.random.default_rng(seed)
        return np.exp(0.2 * rng.normal(size=(trials, runs, 4)))

    def drawn(self, rng, *, gain=1.0, every=1):
        """Innovation of 100 patterns of one channel, every so many misses larger."""
        miss = rng.normal(0, 0.1, (100, 1))
        miss[::every] *= gain
        near = rng.integers(0, 600, (100, WATCH.near))
        ground = Ground(np.ones(100, bool), near, np.full(100, 0.02))
        learned = rng.normal(0, 0.1, (600, 1))
        misses = Misses(miss, np.zeros((100, 1)), learned, np.array([0.1]))
        return innovation(misses, ground, WATCH)

    @pytest.mark.parametrize(("gain", "every"), [(4.0, 1), (5.0, 5)])
    def test_planted_misses_raise_an_alarm_and_normal_ones_none(self, gain, every):
        rng = np.random.default_rng(5)
        rows = np.array([[self.drawn(rng) for _ in range(40)] for _ in range(50)])
        detector = Detector.fresh(WATCH, 40, 1)
        assert not any(detector.update(row).on.any() for row in rows)  # of 2000 trials
        hurt = [self.drawn(rng, gain=gain, every=every) for _ in range(40)]
        assert detector.update(np.array(hurt)).on.mean() >= 0.95

    def test_undamaged_robots_raise_hardly_an_alarm(self):
        detector = Detector.fresh(WATCH, 20, 4)
        alarms = sum(detector.update(row).on.sum() for row in self.noise(500))
        assert alarms <= 20  # of 10 000 trials: 1 in 500

    def test_a_channel_that_grows_fivefold_is_named_at_once(self):
        detector, rows = Detector.fresh(WATCH, 20, 4), self.noise(30)
        for row in rows[:-1]:
            assert not detector.update(row).on.any()
        rows[-1, :, 2] = 25.0
        found = detector.update(rows[-1])
        assert found.on.all()
        assert (found.suspect == 2).all()
        assert (found.score > WATCH.threshold).all()

    def test_learning_and_the_first_trials_raise_none(self):
        detector = Detector.fresh(WATCH, 1, 4)
        for trial in range(30):
            level = max(0.02, 20 * np.exp(-0.3 * trial))
            assert not detector.update(np.full((1, 4), level)).on.any()

    def test_less_than_expected_is_no_damage_however_much_it_grew(self):
        detector = Detector.fresh(WATCH, 1, 4)
        for trial in range(30):
            level = 0.9 if trial == 20 else 0.01
            assert not detector.update(np.full((1, 4), level)).on.any()

    def test_after_an_alarm_the_new_robot_is_learned(self):
        detector = Detector.fresh(WATCH, 1, 4)
        rows = np.ones((40, 1, 4))
        rows[20:26, 0] = np.array([20, 9, 2, 30, 4, 9.0])[:, None]
        rows[26:] = 3.0
        on = [bool(detector.update(row).on[0]) for row in rows]
        assert np.flatnonzero(on).tolist() == [20]

    def test_an_alarm_blinds_for_the_warmup_and_no_longer(self):
        detector = Detector.fresh(WATCH, 1, 4)
        rows = np.ones((30, 1, 4))
        rows[12], rows[12 + WATCH.warmup + 1] = 17.0, 8.0
        on = [bool(detector.update(row).on[0]) for row in rows]
        assert np.flatnonzero(on).tolist() == [12, 12 + WATCH.warmup + 1]

    def test_lost_trials_are_no_news(self):
        detector = Detector.fresh(WATCH, 1, 4)
        for trial in range(30):
            row = np.full((1, 4), np.nan if trial % 4 == 3 else 1.0)
            assert not detector.update(row).on.any()


class TestForgetting:
    def data(self, *, gain=1.0, noise=0.02, trials=6, seed=3):
        """Patterns of a linear robot whose last trial has another gain."""
        rng = np.random.default_rng(seed)
        inputs = rng.uniform(-1, 1, (trials * 80, 2))
        number = np.repeat(np.arange(trials), 80)
        factor = np.where(number == trials - 1, gain, 1.0)[:, None]
        targets = factor * inputs @ np.array([[0.5], [0.3]])
        return inputs, targets + noise * rng.normal(size=targets.shape), number

    def test_the_same_robot_keeps_everything(self):
        assert len(contradicted(*self.data(), WATCH)) == 0

    def test_another_robot_drops_all_that_came_before(self):
        got = contradicted(*self.data(gain=0.2), WATCH)
        assert got.tolist() == [0, 1, 2, 3, 4]

    def test_noise_alone_is_no_contradiction(self):
        inputs, targets, trials = self.data()
        rng = np.random.default_rng(0)
        last = trials == trials.max()
        targets[last] += 0.04 * rng.normal(size=targets[last].shape)
        assert len(contradicted(inputs, targets, trials, WATCH)) == 0

    def test_a_robot_that_fails_now_and_then_is_another_one(self):
        inputs, targets, trials = self.data()
        inputs *= 0.3  # the same in little space: patterns lie close
        targets *= 0.3
        last = np.flatnonzero(trials == trials.max())
        targets[last[::5]] = -1.0
        assert contradicted(inputs, targets, trials, WATCH).tolist() == [0, 1, 2, 3, 4]

    @pytest.mark.parametrize("same", [2, 5])
    def test_what_is_older_than_a_change_goes_seen_again_or_not(self, same):
        inputs, targets, trials = self.data(gain=0.2)
        inputs[trials == 0] += 5.0
        kept = trials >= same  # trials of the robot as it is now
        targets[kept] = 0.2 * inputs[kept] @ np.array([[0.5], [0.3]])
        got = contradicted(inputs, targets, trials, WATCH)
        assert got.tolist() == list(range(same))

    def test_ground_that_was_not_seen_again_is_kept(self):
        inputs, targets, trials = self.data(gain=0.2)
        inputs[trials < 5] += 5.0
        assert len(contradicted(inputs, targets, trials, WATCH)) == 0

    @pytest.mark.parametrize("seed", range(5))
    def test_a_robot_that_settled_elsewhere_is_the_same(self, seed):
        inputs, _, trials = self.data(seed=seed)
        inputs *= 0.3
        last = trials == trials.max()
        inputs[last] = 0.1 + 0.01 * inputs[last]  # one command, nearly, for a trial
        targets = inputs @ np.array([[0.5], [0.3]])
        assert len(contradicted(inputs, targets, trials, WATCH)) == 0

    def test_changes_below_the_floor_do_not_count(self):
        inputs, _, trials = self.data()
        changed = (trials == trials.max())[:, None].astype(float)
        for size, gone in ((0.9, 0), (1.1, 5)):
            targets = size * WATCH.forget_floor * changed
            assert len(contradicted(inputs, targets, trials, WATCH)) == gone

    def test_misses_are_held_against_what_networks_err_by(self):
        inputs, targets, trials = self.data(gain=0.2)
        misses = targets - inputs @ np.array([[0.5], [0.3]])
        got = contradicted(inputs, misses, trials, WATCH, np.array([0.02]))
        assert got.tolist() == [0, 1, 2, 3, 4]
        assert len(contradicted(inputs, misses, trials, WATCH, np.array([0.3]))) == 0

    @pytest.mark.parametrize("count", [0, 1])
    def test_too_little_to_judge(self, count):
        inputs, targets, trials = (part[:count] for part in self.data())
        assert len(contradicted(inputs, targets, trials, WATCH)) == 0


class TestInTheLearner:
    def drive(self, learner, trial):
        """A trial of a random controller, with readings as noisy as real ones."""
        genome = learner.problem.random().genes[0, :1, :, 0]
        policy = GenomePolicy(learner.problem.simulator.controllers, genome)
        (seen,) = FakeLightWorld().drive(policy, cycles=60, seeds=[trial])
        noise = np.zeros_like(seen.observed)
        noise[:, 3:] = np.random.default_rng(trial).normal(0, 100, noise[:, 3:].shape)
        return [seen.replace(observed=seen.observed + noise)]

    @pytest.mark.parametrize(
        ("broken", "name"), [(3, "left sensor"), (4, "right sensor")]
    )
    def test_a_dead_sensor_is_named_and_reacted_to(self, broken, name):
        config = small_light()
        config = replace(config, snn=replace(config.snn, epochs=60))
        watch = WatchConfig(detect=True, warmup=4, history=6)
        reset = replace(config.adaptation, population_reset=True)
        config = replace(config, watch=watch, adaptation=reset)
        learner = Bns([config], replicates=[0], onsets=[10])
        for trial in range(10):
            row = learner.observe(trial, self.drive(learner, trial), None)
            assert not row["detected"].any()
        seen = self.drive(learner, 10)[0]
        damaged = seen.observed.copy()
        damaged[:, broken] = 0.0  # in full light, wherever it is
        row = learner.observe(10, [seen.replace(observed=damaged)], None)
        assert row["detected"] == 1
        assert CHANNELS[int(row["suspect"][0])] == name
        assert learner.adaptations.resets(11).population.all()

    def test_what_is_contradicted_is_dropped_with_its_trial_numbers(self):
        config = replace(small_light(), watch=WatchConfig(forget=True))
        learner = Bns([config], replicates=[0], onsets=[-1])
        for trial in range(3):
            row = learner.observe(trial, self.drive(learner, trial), None)
        for part in learner.memories:
            assert len(part.trials[0]) == part.buffer.counts[0]
        state = learner.state()
        other = Bns([config], replicates=[0], onsets=[-1])
        other.restore(state)
        assert np.array_equal(
            other.memories[0].trials[0], learner.memories[0].trials[0]
        )
        assert "forgotten" in row


WATCHED = WatchConfig(detect=True, forget=True, warmup=4, history=8)


def broken(wheel, onset=10):
    world = WorldConfig(
        name="static-snn", damage=(f"wheel_gain:wheel={wheel},factor=0.3@{onset}",)
    )
    return replace(
        SMALL,
        watch=WATCHED,
        world=world,
        snn=SnnConfig(epochs=150),
        adaptation=AdaptationConfig(population_reset=True),
    )


def test_a_learner_that_is_not_asked_to_watch_says_nothing_of_it():
    (row,) = play(batch(SMALL), 1)
    assert not {"detected", "suspect", "alarm_score", "forgotten"} & set(row)


@pytest.mark.parametrize("wheel", ["left", "right"])
def test_a_slow_wheel_is_found_named_forgotten_and_reacted_to(wheel):
    made = batch(broken(wheel))
    rows = play(made, 11)
    assert not any(row["detected"].any() for row in rows[:10])
    last = rows[10]
    assert last["detected"].mean() > 0.5
    named = last["suspect"][last["detected"] > 0].astype(int)
    assert {WheeledProblem.channels[name] for name in named} == {f"{wheel} wheel"}
    resets = made.learner.adaptations.resets(11).population
    assert np.array_equal(resets, last["detected"] > 0)
    assert last["forgotten"].sum() > np.mean([row["forgotten"].sum() for row in rows])
    for run, marks in enumerate(made.learner.memories[0].trials):
        assert len(marks) == made.learner.memories[0].buffer.counts[run]


def test_restored_goes_on_to_the_same_bytes():
    config = broken("left", onset=3)
    whole, cut, again = (batch(config) for _ in range(3))
    play(whole, 5)
    play(cut, 3)
    again.learner.restore({n: a.copy() for n, a in cut.learner.state().items()})
    play(again, 2, start=3)
    expected, found = whole.learner.state(), again.learner.state()
    assert expected.keys() == found.keys()
    for name, array in expected.items():
        assert array.tobytes() == found[name].tobytes(), name


@pytest.mark.parametrize(("left", "right"), [(0.1, 0.1), (0.2, 0.1), (-0.05, 0.1)])
def test_how_far_the_wheels_rolled_is_read_from_an_arc(left, right):
    turn = (right - left) / AXLE
    arc = (left + right) / 2
    chord = arc * np.sinc(turn / 2 / np.pi)
    moved = [chord * np.cos(turn / 2), chord * np.sin(turn / 2), turn]
    np.testing.assert_allclose(ways(np.array(moved)), [left, right], atol=1e-12)
