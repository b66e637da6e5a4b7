"""Tasks and paths against hand-computed answers."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from bns import presets, tasks
from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import RunConfig
from bns.experiment.loading import with_learner
from bns.experiment.run import train
from bns.experiment.task_settings import TaskConfig
from bns.snn.network import integrate
from bns.tasks import navigation
from bns.tasks.navigation import Route
from bns.tasks.park import TURN_COST, Bay, ParkTask
from bns.worlds import registry
from bns.worlds.trial import Commands, Trial

GOALS = [(0.3, -0.3), (-0.3, -0.3), (-0.3, 0.3), (0.3, 0.3), (0.3, -0.3)]


def score(points, length=None, **settings):
    task = Route.of(TaskConfig(**settings))
    x, y = torch.tensor(points, dtype=torch.float64).T
    length = torch.tensor(len(points) if length is None else length)
    cost, reached = task.score(x, y, length)
    return cost.item(), reached.item()


def test_perfect_path_costs_its_commands_alone():
    cost, reached = score(GOALS)
    assert reached == 5
    assert cost == pytest.approx(5 * 5.0, abs=1e-4)


def test_algorithm_5_by_hand():
    """One objective reached at 5 cm, then standing 55 cm from the next."""
    cost, reached = score(
        [(0.25, -0.3), (0.25, -0.3)], charge_unused=False, command_cost=0.0
    )
    assert reached == 1
    assert cost == pytest.approx(5 + 55 + 4 * 10_000)


def test_squared_reading():
    cost, _ = score([(0.3, -0.2)], charge_unused=False, squared=True, command_cost=0.0)
    assert cost == pytest.approx(100 + 5 * 10_000)


def test_unused_commands_are_charged_so_giving_up_does_not_pay():
    padded = [(0.0, 0.0)] * 4
    printed = [score(padded, n, charge_unused=False)[0] for n in (1, 4)]
    repaired = [score(padded, n)[0] for n in (1, 4)]
    assert printed[0] < printed[1] - 100
    assert repaired[1] - repaired[0] == pytest.approx(3 * 5.0)


def test_a_place_counts_once_per_command():
    assert score([(0.3, -0.3)] * 3)[1] == 1


def test_reached_only_inside_the_radius():
    assert score([(0.3, -0.3 + 0.0899)])[1] == 1
    assert score([(0.3, -0.3 + 0.0901)])[1] == 0


def test_infinity_passes_the_centre_twice():
    task = Route.of(TaskConfig(name="infinity"))
    assert task.goals.tolist().count([0.0, 0.0]) == 2
    assert len(task.goals) == 7


def test_unknown_task():
    with pytest.raises(UnknownNameError, match="Unknown task 'simpel'"):
        Route.of(TaskConfig(name="simpel"))


def test_integration_of_a_square():
    quarter = torch.full((4,), math.pi / 2, dtype=torch.float64)
    ahead = torch.ones(4, dtype=torch.float64)
    x, y, yaw = integrate(ahead, torch.zeros_like(ahead), quarter, (0.0, 0.0, 0.0))
    assert x.tolist() == pytest.approx([1, 1, 0, 0])
    assert y.tolist() == pytest.approx([0, 1, 1, 0])
    assert yaw[-1].item() == pytest.approx(2 * math.pi)


def test_integration_undoes_body_displacements():
    from bns.worlds.trial import body_displacements

    poses = torch.rand(9, 3, generator=torch.Generator().manual_seed(0)).double()
    moved = torch.from_numpy(body_displacements(poses.numpy()))
    x, y, yaw = integrate(*moved.T, tuple(poses[0].tolist()))
    torch.testing.assert_close(torch.stack([x, y, yaw], 1), poses[1:])


ROUTES = [name for name in tasks.names() if tasks.kind(name) == "navigation"]


@pytest.mark.parametrize("name", ROUTES)
def test_every_route_can_be_driven(name):
    """Contract of a route's file: a path through all costs no penalty."""
    config = TaskConfig(name=name)
    places = navigation.objectives(config)
    letters = navigation.order(name)
    assert set(letters) <= set(places)
    assert all(abs(x) <= 1.35 and abs(y) <= 0.9 for x, y in places.values())
    cost, reached = score([places[letter] for letter in letters], name=name)
    assert reached == len(letters)
    assert cost < config.penalty


def configured(name):
    robot = "phantomx" if tasks.kind(name) == "walk" else "khepera3"
    changes = {"task.name": name, "world.robot": robot}
    return RunConfig().with_(changes)


@pytest.mark.parametrize("name", tasks.names())
class TestEveryTask:
    def test_it_says_what_it_is(self, name):
        assert len(tasks.describe(name)) > 20
        shown = tasks.of(configured(name)).picture
        assert shown.name and shown.solved and shown.discs
        assert set(shown.order) <= set(shown.objectives)

    def test_its_space_holds_random_controllers_and_decodes_them(self, name):
        task = tasks.of(configured(name))
        space, rng = task.space, np.random.default_rng(0)
        vectors = space.random(7, rng)
        assert vectors.shape == (7, space.size)
        assert (vectors >= space.low).all() and (vectors <= space.high).all()
        assert (space.first_low >= space.low).all()
        assert (space.first_high <= space.high).all()
        assert len(space.controllers(vectors)) == 7
        wide = space.high + np.array([[1.0], [2.0]])
        assert len(space.controllers(wide)) == 2  # clipped, not refused

    def test_vectors_of_another_length_and_nan_are_refused(self, name):
        space = tasks.of(configured(name)).space
        with pytest.raises(BnsError, match="they need"):
            space.controllers(np.zeros((1, space.size + 1)))
        with pytest.raises(BnsError, match="NaN"):
            space.controllers(np.full((1, space.size), np.nan))


def test_a_vector_of_navigation_is_its_commands_and_how_many():
    task = tasks.of(configured("simple"))
    space = task.space
    vector = space.low.copy()
    vector[:6] = 0.1, 0.07, 1.0, 0.01, 0.1, 2.0  # below the dead band: a stop
    vector[-1] = 2.3
    (made,) = space.controllers(vector[None])
    np.testing.assert_allclose(made.values, [[0.1, 0.07], [0.0, 0.1]], rtol=1e-6)
    np.testing.assert_allclose(made.durations, [1.0, 2.0])


def test_a_route_of_another_kind_is_refused():
    with pytest.raises(UnknownNameError, match="navigation task"):
        navigation.order("walk")


CONFIG = presets.load("khepera-simple").with_({"task.name": "park"})


def ended(x, y, degrees):
    poses = np.array([[0.0, 0.0, 0.0], [x, y, math.radians(degrees)]])
    return Trial(Commands([[0.1, 0.1]], [1.0]), [0.0, 1.0], poses, [0, 1])


@pytest.mark.parametrize(
    ("pose", "solved", "reached", "cost"),
    [
        ((0.3, 0.3, 180), 1, 1, 5.0),
        ((0.3, 0.3, -180), 1, 1, 5.0),  # the same way
        ((0.3, 0.3, 540), 1, 1, 5.0),  # once round
        ((0.38, 0.3, 180), 1, 1, 13.0),
        ((0.40, 0.3, 180), 0, 0, 15.0),
        ((0.3, 0.3, 90), 0, 1, 5.0 + TURN_COST * math.pi / 2),
    ],
)
def test_cost_and_what_counts_as_parked(pose, solved, reached, cost):
    row = ParkTask(CONFIG).measured([ended(*pose)])
    assert (row["solved"][0], row["reached"][0]) == (solved, reached)
    assert row["fitness"][0] == pytest.approx(cost, abs=1e-3)


def test_an_end_that_was_lost_is_where_it_was_seen_last():
    trial = ended(0.3, 0.3, 180)
    lost = trial.replace(
        commands=Commands([[0.1, 0.1]] * 2, [1.0] * 2),
        times=np.arange(3.0),
        observed=np.vstack([trial.observed, np.full(3, np.nan)]),
        boundaries=np.arange(3),
        handled=np.zeros(2, bool),
    )
    assert ParkTask(CONFIG).fitness([lost])[0] == pytest.approx(10.0, abs=1e-3)


def test_the_network_s_paths_are_judged_by_the_same_rule():
    bay = tasks.of(CONFIG).path_goal()
    assert isinstance(bay, Bay)
    yaw, lengths = torch.full((2, 2), math.pi), torch.tensor([1, 2])
    x = torch.tensor([[0.1, 0.2], [0.3, 0.4]])
    y = torch.tensor([[0.0, 0.1], [0.3, 0.3]])
    assert bay.judge(x, y, yaw, lengths).tolist() == pytest.approx(
        [5.0, 20.0], abs=1e-3
    )


@pytest.mark.parametrize("learner", ["bns", "random"])
def test_a_learner_that_knows_nothing_of_it_learns_it(learner):
    config = CONFIG if learner == "bns" else with_learner(CONFIG, learner)
    if learner == "bns":
        config = config.with_(
            {
                "evolution.generations": 40,
                "evolution.population": 60,
                "snn.epochs": 150,
                "compiled": "no",
            }
        )
    config = replace(config, trials=12, replicates=4, record_replicates=0, threads=1)
    world = registry.make("static-snn", robot="khepera3")
    record = train(config, world=world)
    first, last = record["fitness"][:, 0], record["fitness_best"][:, -4:].min(1)
    assert (last < first).all()
    if learner == "bns":
        assert np.median(last) < 0.5 * np.median(first)
