"""The learner bns as a whole, in an exact and cheap world, and what it deploys."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from threadpoolctl import ThreadpoolController

from bns.draws import Draws
from bns.errors import BnsError
from bns.experiment.batch import ALGEBRA, Batch
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.run import train
from bns.experiment.task_settings import TaskConfig, metres_per_second
from bns.learners.bns.adaptations import Adaptations
from bns.learners.bns.choice import AGE, PAUSE, Deployed, packed, unpack
from bns.learners.bns.config import AdaptationConfig, EvolutionConfig, SnnConfig
from bns.learners.bns.learner import Bns
from bns.learners.bns.memory import PatternBuffer
from bns.learners.bns.navigation import of_trial
from bns.worlds import registry
from bns.worlds.trial import Commands, Outcome, Trial
from tests.bns import robots

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


def test_numpy_computes_on_one_thread_in_a_trial_and_on_as_many_as_before_after(
    monkeypatch,
):
    made = batch(SMALL)
    algebra = ThreadpoolController().select(prefix=ALGEBRA)
    seen = []
    observe = made.learner.observe

    def watched(*given):
        seen.extend(library["num_threads"] for library in algebra.info())
        return observe(*given)

    monkeypatch.setattr(made.learner, "observe", watched)
    with algebra.limit(limits=2):
        before = [library["num_threads"] for library in algebra.info()]
        play(made, 1)
        assert [library["num_threads"] for library in algebra.info()] == before
    assert set(seen) <= {1}


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


def genes(number):
    return np.full((2, 3), number, np.float32)


def noted(run, costs, first=0, foreseen=None):
    """One controller a trial, each with its cost, as foreseen unless said otherwise."""
    for at, (number, cost) in enumerate(costs):
        run.note(
            first + at, genes(number), 2, cost, cost if foreseen is None else foreseen
        )
    return run


class TestWhatIsDeployed:
    def test_the_lowest_cost_seen_where_nothing_is_left_to_chance(self):
        run = noted(Deployed(True), [(1, 5.0), (2, 3.0), (3, 4.0)])
        assert run.best.genes[0, 0] == 2

    def test_a_lucky_one_is_not_believed_where_much_is(self):
        costs = [(1, 5.0), (1, 7.0), (1, 5.0), (1, 7.0), (1, 6.0), (2, 5.6)]
        run = noted(Deployed(False), costs)
        assert run.best.genes[0, 0] == 1
        assert run.wanted(6) is None  # one was tried again just now
        assert run.wanted(4 + PAUSE + 1).genes[0, 0] == 2  # but it may be better

    def test_nothing_is_known_at_first(self):
        assert Deployed(True).best is None and Deployed(True).wanted(0) is None


class TestChange:
    def test_one_that_does_much_worse_again_tells_of_another_robot(self):
        run = noted(Deployed(True), [(1, -100.0), (2, -80.0), (1, -50.0)])
        assert run.changed == 2
        assert [item.genes[0, 0] for item in run.seen] == [1]
        assert run.best.costs == [-50.0]

    def test_a_little_worse_does_not(self):
        run = noted(Deployed(True), [(1, -100.0), (2, -80.0), (1, -95.0)])
        assert run.changed == -1 and len(run.seen) == 2

    def test_what_was_seen_before_the_learner_forgot_is_dropped(self):
        run = noted(Deployed(True), [(1, 1.0), (2, 2.0), (3, 3.0)])
        run.forget(before=2, trial=2)
        assert run.best.genes[0, 0] == 3


class TestDoubt:
    def test_the_deployed_one_is_tried_again_after_some_trials(self):
        run = noted(Deployed(True), [(1, 1.0), *((n, 2.0) for n in range(2, AGE + 1))])
        assert run.wanted(AGE - 1) is None
        assert run.wanted(AGE).genes[0, 0] == 1

    def test_and_at_once_after_a_surprise(self):
        run = noted(Deployed(True), [(n, 1.0 + n / 10) for n in range(6)], foreseen=1.0)
        assert run.wanted(6) is None
        run.note(6, genes(9), 2, 50.0, 1.0)
        assert run.wanted(7).genes[0, 0] == 0
        run.note(7, genes(0), 2, 1.0, 1.0)  # it does as before
        assert not run.surprised and run.wanted(8) is None


def test_it_comes_back_from_plain_arrays():
    runs = [noted(Deployed(True), [(1, 5.0), (2, 3.0), (2, 3.1)]), Deployed(True)]
    held = packed(runs, (2, 3))
    again = [Deployed(True), Deployed(True)]
    unpack(again, held)
    for name, value in packed(again, (2, 3)).items():
        assert value.tobytes() == held[name].tobytes(), name
    assert again[0].best.costs == [3.0, 3.1] and again[1].best is None


class Broken(robots.Slider):
    """From trial 12 on it gets a third as far."""

    def run(self, commands, *, trial=0, seeds=()):
        found = super().run(commands)
        if trial < 12:
            return found
        return [t.replace(observed=t.observed / 3) for t in found]


def deploying(**changes):
    return replace(robots.small(**changes), deploy="seen")


def test_deployed_it_goes_as_far_as_was_seen_since_the_robot_changed():
    batch = Batch([deploying(trials=30)], [Broken()])
    rows = [batch.advance(trial)[0].columns for trial in range(30)]
    seen, best = (
        np.stack([np.sqrt(-row[name]) for row in rows], 1)
        for name in ("fitness", "fitness_best")
    )
    until = np.maximum.accumulate(seen, axis=1)
    np.testing.assert_allclose(best[:, 1:12], until[:, :11], rtol=1e-5)
    for kept in batch.learner.deployed:
        assert 12 <= kept.changed <= 12 + AGE
        since = seen[:, kept.changed :].max(1)
        assert np.isclose(best[:, -1], since, rtol=1e-5).any()
    assert np.stack([row["retried"] for row in rows]).mean() <= 1 / (PAUSE + 1)


@pytest.mark.parametrize("small", [deploying, None])
def test_killed_and_resumed_it_gives_the_same_bytes(tmp_path, small):
    config = deploying(trials=8)
    world = robots.Slider()
    if small is None:
        config = replace(robots.small_light(), deploy="seen", trials=8)
        world = robots.FakeLightWorld()
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    record = train(config, whole, world=world)
    asked = iter([False] * 5 + [True])
    train(config, cut, world=world, stop=lambda: next(asked))
    train(config, cut, world=world, resume=True)
    assert (whole / "state.npz").read_bytes() == (cut / "state.npz").read_bytes()
    assert {"solved_best", "retried"} <= set(record.columns)


def test_off_it_is_as_it_was():
    record = train(robots.small(trials=3), world=robots.Slider())
    assert not {"solved_best", "retried"} & set(record.columns)


def test_a_report_shows_deployed_and_tried_apart(tmp_path):
    from bns.viz import report

    record = train(deploying(trials=6), world=robots.Slider())
    page = report.write(record, tmp_path / "r.html").read_text()
    assert "Deployed, it solves" in page
    plain = train(robots.small(trials=3), world=robots.Slider())
    assert "Deployed" not in report.write(plain, tmp_path / "p.html").read_text()
