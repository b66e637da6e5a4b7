"""The learner as a whole, in an exact and cheap world."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from bns.draws import Draws
from bns.errors import BnsError
from bns.experiment.batch import Batch
from bns.experiment.config import (
    AdaptationConfig,
    EvolutionConfig,
    RunConfig,
    SnnConfig,
    TaskConfig,
    WorldConfig,
)
from bns.learners.bns.adaptation import Adaptations
from bns.learners.bns.learner import Bns
from bns.learners.bns.memory import PatternBuffer
from bns.learners.bns.navigation import of_trial
from bns.units import metres_per_second
from bns.worlds import registry
from bns.worlds.trial import Commands, Outcome, Trial

SMALL = RunConfig(
    replicates=3,
    trials=4,
    evolution=EvolutionConfig(population=20, generations=3),
    snn=SnnConfig(epochs=15),
    compiled="no",
    threads=1,
    world=WorldConfig(name="static-snn"),
)


def batch(*configs: RunConfig) -> Batch:
    worlds = [
        registry.make("static-snn", robot="khepera3", damage=config.world.damage)
        for config in configs
    ]
    return Batch(configs, worlds)


def play(made: Batch, trials: int, start: int = 0) -> list[dict]:
    return [made.advance(t)[0].columns for t in range(start, start + trials)]


def test_same_seed_same_bytes_and_another_seed_others():
    one, two = batch(SMALL), batch(SMALL)
    other = batch(replace(SMALL, seed=1))
    for made in (one, two, other):
        play(made, 3)
    assert one.learner.theta.numpy().tobytes() == two.learner.theta.numpy().tobytes()
    assert not torch.equal(one.learner.theta, other.learner.theta)


def test_restored_goes_on_to_the_same_bytes():
    whole, cut = batch(SMALL), batch(SMALL)
    play(whole, 4)
    play(cut, 2)
    state = {name: array.copy() for name, array in cut.learner.state().items()}
    again = batch(SMALL)
    again.learner.restore(state)
    play(again, 2, start=2)
    expected, found = whole.learner.state(), again.learner.state()
    assert expected.keys() == found.keys()
    for name, array in expected.items():
        assert array.tobytes() == found[name].tobytes(), name


def test_learns_the_simple_problem():
    config = replace(
        SMALL,
        replicates=4,
        task=TaskConfig(),
        evolution=EvolutionConfig(population=80, generations=40),
        snn=SnnConfig(epochs=200),
        adaptation=AdaptationConfig(window=150),
    )
    made = batch(config)
    rows = play(made, 12)
    solved = np.array([row["solved"] for row in rows])
    assert solved.any(0).sum() >= 1
    assert rows[-1]["snn_forward"].mean() < 0.3 * rows[0]["snn_forward"].mean()


@pytest.mark.parametrize(
    "choose", ["tournament", "random", "best-worst-random", "disagreement"]
)
def test_every_choice_runs_and_measures_the_best_beside(choose):
    config = replace(SMALL, choose=choose)
    if choose == "disagreement":
        config = replace(config, snn=SnnConfig(kind="ensemble", epochs=5, hidden=8))
    rows = play(batch(config), 4)
    assert all(np.isfinite(row["fitness_best"]).all() for row in rows)
    assert any((row["fitness_best"] != row["fitness"]).any() for row in rows)


def test_disagreement_needs_an_ensemble():
    with pytest.raises(BnsError, match="needs an ensemble"):
        play(batch(replace(SMALL, choose="disagreement")), 2)


def test_runs_that_cannot_share_a_batch_are_refused():
    other = replace(SMALL, evolution=EvolutionConfig(population=30))
    with pytest.raises(BnsError, match="adaptation"):
        Bns([SMALL, other], replicates=[0, 0], onsets=[-1, -1])


def test_window_slides_and_runs_have_their_own():
    buffer = PatternBuffer(2, [5, 0])
    for start in (0, 4, 8):
        rows = np.arange(start, start + 4)[:, None]
        for run in (0, 1):
            buffer.append(run, np.repeat(rows, 5, 1), np.repeat(rows, 3, 1))
    assert buffer.counts.tolist() == [5, 12]
    assert buffer.inputs[0][:, 0].tolist() == [7, 8, 9, 10, 11]
    inputs, _, weight = buffer.tensors()
    assert inputs.shape == (2, 5, 64)
    assert weight.sum((1, 2, 3)).tolist() == [5, 12]


def test_lost_and_diverged_poses_train_nothing():
    commands = Commands([[0.1, 0.1]] * 3, [1.0] * 3)
    seen = np.array([[0, 0, 0], [0.1, 0, 0], [np.nan] * 3, [0.3, 0, 0]], float)
    trial = Trial(commands, np.arange(4.0), seen, np.arange(4))
    assert of_trial(trial)[1].tolist() == [[pytest.approx(0.1), 0, 0]]
    assert len(of_trial(trial.replace(outcome=Outcome(diverged=True)))[0]) == 0


def schedule(onset=10, **adaptation) -> Adaptations:
    config = replace(SMALL, adaptation=AdaptationConfig(**adaptation))
    return Adaptations([config, SMALL], [onset, -1])


def test_told_resets_come_once_after_the_first_damaged_trial():
    made = schedule(population_reset=True, data_reset=True)
    told = [t for t in range(30) if made.resets(t).population[0]]
    assert told == [11]
    assert made.resets(11).data.tolist() == [True, False]
    assert not made.resets(11).simulator.any()


def test_restart_resets_all_three():
    resets = schedule(restart=True).resets(11)
    assert resets.population[0] and resets.simulator[0] and resets.data[0]


def test_simulator_reset_every_k_trials():
    made = schedule(simulator_reset_every=4)
    assert [t for t in range(13) if made.resets(t).simulator[0]] == [4, 8, 12]


def test_mutation_rises_after_damage():
    made = schedule(mutation_rate_after=0.2, mutation_magnitude_after=3500.0)
    rate, size = made.mutation(10)
    assert rate.tolist() == pytest.approx([0.1, 0.1])
    rate, size = made.mutation(11)
    assert rate.tolist() == pytest.approx([0.2, 0.1])
    assert size[0, 0] == pytest.approx(metres_per_second(3500.0))
    assert size[1, 0] == pytest.approx(metres_per_second(2000.0))


def test_simulator_reset_keeps_the_data_and_retrains():
    config = replace(SMALL, adaptation=AdaptationConfig(simulator_reset_every=2))
    made = batch(config)
    play(made, 2)
    counts = made.learner.memories[0].buffer.counts
    before = made.learner.theta.clone()
    made.learner.propose(2)
    assert made.learner.memories[0].buffer.counts.tolist() == counts.tolist()
    assert not torch.equal(made.learner.theta, before)


@pytest.mark.parametrize("untrained", [True, False])
def test_a_reset_simulator_is_trained_at_once_or_after_the_next_trial(untrained):
    made = schedule(simulator_reset=True, simulator_reset_untrained=untrained)
    resets = made.resets(11)
    assert resets.simulator.tolist() == [True, False]
    assert resets.trained.tolist() == [not untrained, False]
    told = AdaptationConfig(simulator_reset=True, simulator_reset_untrained=untrained)
    damaged = replace(SMALL.world, damage=("wheel_gain:wheel=left,factor=0.8@1",))
    playing = batch(replace(SMALL, adaptation=told, world=damaged))
    play(playing, 2)
    (memory,) = playing.learner.memories
    fitted = memory.loss.clone()
    playing.learner.propose(2)
    assert torch.equal(memory.loss, fitted) == untrained


def test_draws_restore():
    draws = Draws(3)
    draws.uniform(7)
    state = draws.state()
    expected = draws.uniform(5, 2)
    draws.uniform(100)
    draws.restore(state)
    assert torch.equal(draws.uniform(5, 2), expected)
