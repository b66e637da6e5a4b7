"""Learners that evolve controllers in a model, on robots whose damage is planted.

PETS has an ensemble's own paths, and a search that goes on from trial to trial. How
vectors are bred for one goal and for several, and numbers of a model that may be wrong,
are tested by themselves.
"""

from dataclasses import replace

import numpy as np
import pytest
import torch

from bns import presets
from bns.errors import BnsError
from bns.experiment.batch import Batch
from bns.experiment.loading import with_learner
from bns.learners import registry
from bns.learners.bns.navigation import Evaluator
from bns.learners.pets import Particles, Pets
from bns.prior.model_learner import bred, crowding, fronts, inside, ranked
from bns.prior.modelling import Unknowns, varied
from bns.worlds import registry as worlds
from bns.worlds.damage import Damage
from bns.worlds.world import CountedWorld
from tests.bns.robots import Slider, wheels

SLOW = "wheel_gain:wheel=left,factor=0.8"
FITTING = ("anytime", "back_to_reality", "self_modelling")
TRANSFERRING = ("transferability", "t_resilience")
EVOLVING = FITTING + TRANSFERRING


def batch(
    learner,
    world,
    model,
    *,
    runs=2,
    most=5000,
    preset="khepera-simple",
    damage=(),
    **own,
):
    """Runs in a world, each with a model of its own."""
    base = replace(presets.load(preset), replicates=runs, trials=40, threads=1)
    told = {f"settings.{name}": value for name, value in own.items()}
    config = with_learner(base, learner).with_({**told, "world.damage": damage})
    models = [CountedWorld(model, most) for _ in range(runs)]
    return Batch([config], [world], models=models), models


@pytest.mark.parametrize("learner", FITTING)
def test_the_wheel_that_is_slow_is_found(learner):
    own = {"first": 30, "each": 200, "replayed": 6}
    made, _ = batch(learner, wheels([SLOW]), wheels(), runs=3, **own)
    misses = [made.advance(trial)[0].columns["model_miss"] for trial in range(9)]
    memories = made.learner.memories
    found = np.median([made.learner.best_guess(memory) for memory in memories], axis=0)
    np.testing.assert_allclose(found, [0.8, 1.0], atol=0.06)
    assert np.median(misses[-1]) < 0.5 * np.median(misses[2]) or learner != "anytime"


def test_what_is_no_number_of_the_model_is_not_explained():
    late = "command_latency:delay=0.3"
    misses = {}
    for damage in (SLOW, late):
        own = {"first": 30, "each": 200, "replayed": 6}
        made, _ = batch("self_modelling", wheels([damage]), wheels(), runs=1, **own)
        rows = [made.advance(trial)[0].columns["model_miss"] for trial in range(9)]
        misses[damage] = float(rows[-1][0])
    assert misses[late] > 2 * misses[SLOW]


def test_a_leg_that_is_held_up_is_named_by_self_modelling():
    raised = Slider([Damage.parse(["leg_raised:legs=3,blend=1"])] * 3)
    own = {"first": 20, "each": 400}
    made, _ = batch(
        "self_modelling", raised, Slider(), runs=3, preset="hexapod-walk", **own
    )
    for trial in range(9):
        made.advance(trial)
    learner = made.learner
    named = [learner.best_guess(memory).argmax() for memory in learner.memories]
    assert named.count(2) >= 2


@pytest.mark.parametrize("learner", EVOLVING)
def test_each_spends_what_it_may_and_then_goes_on_without(learner):
    own = {"first": 40, "each": 30}
    made, models = batch(learner, wheels([SLOW]), wheels(), most=100, **own)
    spent = []
    for trial in range(5):
        made.advance(trial)
        spent.append(models[0].spent)
    assert 0 < spent[0] <= 40 and spent[1] <= spent[0] + 30
    assert spent[-1] <= 100 and np.isfinite(made.learner.memories[0].seen).all()


@pytest.mark.parametrize("learner", EVOLVING)
def test_deployed_is_the_best_that_was_seen_since_the_robot_changed(learner):
    own = {"first": 60, "each": 40}
    late = [SLOW + "@3"]
    made, _ = batch(learner, wheels(late), wheels(), runs=1, damage=late, **own)
    for trial in range(8):
        step, _ = made.advance(trial)
        if trial == 3:
            memory = made.learner.memories[0]
            assert len(memory.seen) == 4
            before = memory.tests[memory.seen.argmax()]
            newest = memory.tests[-1]
    memory = made.learner.memories[0]
    assert len(memory.seen) == 5  # the first with the damage is remembered
    np.testing.assert_array_equal(memory.tests[0], newest)
    assert (memory.tests[:2] == before).all(1).any()  # what was deployed is tried again
    best = memory.tests[memory.seen.argmax()]
    np.testing.assert_array_equal(made.learner.deployed(memory), best)
    worth = -step.columns["fitness_best"][0]
    assert worth == pytest.approx(memory.seen[:-1].max(), rel=1e-5)


def test_told_never_nothing_is_forgotten_but_the_oldest():
    own = {"first": 20, "each": 10, "told": "never", "remembered": 6}
    late = [SLOW + "@3"]
    made, _ = batch("t_resilience", wheels(late), wheels(), runs=1, damage=late, **own)
    for trial in range(8):
        made.advance(trial)
    assert len(made.learner.memories[0].seen) == 6


class Forked:
    """Walks as the model does, less the more it is to be on legs 1 and 2."""

    name, robot = "forked", "phantomx"

    def run(self, commands, **told):
        found = Slider().run(commands)
        down = [(item.values[:, [1, 4]] <= 0).mean() for item in commands]
        return [
            trial.replace(observed=(1 - much) ** 3 * trial.observed)
            for trial, much in zip(found, down, strict=True)
        ]


def test_t_resilience_learns_what_transfers_and_chooses_it():
    own = {"first": 400, "each": 40, "tests": 15}
    made, _ = batch(
        "t_resilience", Forked(), Slider(), preset="hexapod-walk", runs=3, **own
    )
    rows = [made.advance(trial)[0].columns for trial in range(25)]
    learner, deployed = made.learner, np.sqrt(-rows[-1]["fitness_best"]) / 100
    alone = []
    for memory in learner.memories:
        best = learner.controllers(memory.genes[[memory.worth.argmax()]])
        alone.append(learner.task.worth(Forked().run(best))[0])
    assert np.median(deployed) > 1.3 * np.median(alone)
    expected = learner.expected(learner.memories[0], learner.memories[0].done)
    assert expected.std() > 0


class TestRefused:
    def test_a_range_that_cannot_be_read(self):
        with pytest.raises(BnsError, match="no effect with a range"):
            batch("anytime", wheels(), wheels(), unknown=["wheel_gain"])

    def test_a_model_that_effects_cannot_change(self):
        class Stiff:
            name, robot = "stiff", "khepera3"

            def run(self, commands, **told):
                return wheels().run(commands)

        made, _ = batch("anytime", wheels(), Stiff(), first=5, each=20)
        with pytest.raises(BnsError, match="cannot be changed by effects"):
            made.advance(0)
            made.advance(1)

    def test_settings_out_of_bounds(self):
        config = with_learner(presets.load("khepera-simple"), "self_modelling")
        with pytest.raises(BnsError, match=r"settings\.jury"):
            config.with_({"settings.jury": 1})
        assert registry.get("anytime").open_loop


def config(preset="khepera-simple", **told):
    base = replace(presets.load(preset), trials=8, replicates=2, threads=1)
    search = {"population": 60, "iterations": 10, "elites": 10}
    own = {f"settings.{name}": value for name, value in search.items()}
    cut = {"compiled": "no", "snn.epochs": 60, "world.damage": []}
    return with_learner(base, "pets").with_({**cut, **own, **told})


def made(**told):
    return Pets([config(**told)] * 2, replicates=[0, 1], onsets=[-1, -1])


def test_a_list_costs_what_the_paths_of_all_networks_cost_on_average():
    learner = made()
    problem, theta = learner.problem, learner.theta
    together = problem.evaluator
    assert isinstance(together, Particles) and problem.shape.groups == 5
    lists = problem.encoding.random(2, 7, learner.draws)
    alone = Evaluator(**(vars(together) | {"shape": replace(together.shape, groups=1)}))
    first, bias, second, last = (
        part.reshape(2, 5, -1) for part in together.shape.split(theta)
    )
    costs = [
        alone.cost(
            torch.cat([first[:, i], bias[:, i], second[:, i], last[:, i]], dim=1), lists
        )
        for i in range(5)
    ]
    torch.testing.assert_close(
        together.cost(theta, lists), torch.stack(costs).mean(0), rtol=1e-4, atol=0.1
    )


def test_networks_are_an_ensemble_without_dropout_whatever_is_said():
    learner = made(**{"snn.kind": "three", "snn.dropout": 0.5})
    assert learner.config.snn.kind == "ensemble" and learner.config.snn.dropout == 0
    assert learner.config.snn.hidden == presets.load("khepera-simple").snn.hidden


def test_the_search_goes_on_and_the_cost_inside_the_ensemble_falls():
    world = worlds.make("static-snn", robot="khepera3")
    batch = Batch([config()], [world])
    learner, errors = batch.learner, []
    for trial in range(8):
        step, _ = batch.advance(trial)
        errors.append(step.columns["snn_turn"])
    assert np.median(errors[-1]) < 0.5 * np.median(errors[1])
    before = learner.problem.cost(learner.memories, learner.population).min(1).values
    learner.propose(8)
    assert (learner.cost[:, 0] <= before).all()
    assert (learner.cost[:, 0] < before).any()
    assert learner.population.lengths.shape == (2, 10)


def test_a_told_damage_resets_what_the_preset_says_as_in_bns():
    told = [config(**{"adaptation.population_reset": True}), config()]
    learner = Pets(told, replicates=[0, 1], onsets=[2, 2])
    world = worlds.make("static-snn", robot="khepera3")
    for trial in range(3):
        tried = learner.propose(trial).tried
        trials = learner.task.execute(world, tried, trial=trial, seeds=[0, 1])
        learner.observe(trial, trials, None)
    elites = learner.population.genes.clone()
    learner._reset(3)
    assert not torch.equal(learner.population.genes[0], elites[0])
    assert torch.equal(learner.population.genes[1], elites[1])


GAINS = tuple(f"wheel_gain:wheel={side},factor=0.2..1.2" for side in ("left", "right"))


def dominates(one, other):
    return (one <= other).all() and (one < other).any()


def test_nothing_in_the_first_front_is_dominated_and_all_else_by_the_one_before():
    costs = np.random.default_rng(0).integers(0, 6, (60, 3)).astype(float)
    found = fronts(costs)
    assert sorted(np.concatenate(found)) == list(range(60))
    for number, front in enumerate(found):
        left = np.concatenate(found[number:])
        assert not any(dominates(costs[a], costs[b]) for a in left for b in front)
        for row in front if number else ():
            assert any(dominates(costs[a], costs[row]) for a in found[number - 1])


def test_room_is_that_between_neighbours_and_ends_have_all_of_it():
    costs = np.array([[0.0, 4.0], [1.0, 3.0], [3.0, 1.0], [4.0, 0.0]])
    np.testing.assert_allclose(crowding(costs), [np.inf, 1.5, 1.5, np.inf])
    dominated = np.vstack([[9.0, 9.0], costs])
    assert ranked(dominated)[-1] == 0


def test_children_lie_in_the_cube_and_have_the_genes_of_the_better_ones():
    rng = np.random.default_rng(0)
    genes = np.tile(np.linspace(0, 1, 20)[:, None], (1, 30))
    children = bred(genes, 400, rng)
    assert children.shape == (400, 30) and (children >= 0).all()
    assert (children <= 1).all()
    assert np.median(children) < 0.3  # the best one is at 0
    assert len(bred(genes[:1], 3, rng)) == 3


def test_reflection_keeps_what_is_inside():
    np.testing.assert_allclose(inside(np.array([0.3, -0.2, 1.1])), [0.3, 0.2, 0.9])


class TestUnknowns:
    def test_points_are_effects_and_the_nominal_one_is_none(self):
        found = Unknowns(GAINS)
        (nominal,) = found.damages(found.nominal[None])
        assert all(event.effect.is_nominal for event in nominal.events)
        (slow,) = found.damages(np.array([[0.6, 0.8]]))
        assert slow.events[0].effect["factor"] == pytest.approx(0.8)
        assert slow.events[0].effect["wheel"] == "left"

    def test_the_planted_numbers_are_found(self):
        rng, target = np.random.default_rng(0), np.array([0.6, 0.8])
        points = Unknowns(GAINS).random(8, rng)
        misses = np.linalg.norm(points - target, axis=1)
        for _ in range(30):
            rows = rng.permutation(8)
            made = varied(points, misses, rows, rng)
            off = np.linalg.norm(made - target, axis=1)
            better = off < misses[rows]
            points[rows[better]], misses[rows[better]] = made[better], off[better]
        assert misses.min() < 0.01

    @pytest.mark.parametrize("text", ["wheel_gain:wheel=left", "x:a=2..1", "rubbish"])
    def test_a_text_without_a_range_is_refused(self, text):
        with pytest.raises(BnsError, match="no effect with a range"):
            Unknowns([text])
