"""The ceiling: direct evolution in the damaged world, no SNN in between."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import torch

from bench import experiments
from bench.result import Result
from bns import seeding
from bns.chromosome import Encoding, Population
from bns.config import RunConfig
from bns.draws import Draws
from bns.evolution.generation import Breeder, Rates
from bns.tasks import NavigationTask
from bns.tasks.trials import score_trials
from bns.units import metres_per_second

RUNS, POPULATION, GENERATIONS = 1, 100, 240


DOC = "damages of four that direct evolution in the damaged world solves"
BAR = "none: printed beside recover-window"


def run(quick: bool) -> Result:
    """One direct evolution a damage; quick: what is known already, no new one."""
    names = [d for d in experiments.DAMAGES if not quick or known(d)]
    found = {damage: reached(damage) for damage in names}
    return Result(
        figure=sum(int(row["solved"] > 0) for row in found.values()),
        unit="damages of 4",
        holds=None,
        n=len(found),
        details=found,
    )


def known(damage: str) -> dict[str, object] | None:
    """What direct evolution reached on one damage, if it has been run."""
    place = _place(damage)
    return json.loads(place.read_text()) if place.exists() else None


def _place(damage: str) -> Path:
    config = experiments.damaged(damage, window=150)
    return experiments.RUNS / f"ceiling-{experiments.directory(config).name}.json"


def reached(damage: str) -> dict[str, object]:
    """What direct evolution reaches on one damage; kept, since it takes minutes.

    Args:
        damage: key of `experiments.DAMAGES`.

    Returns:
        runs, how many solved the simple problem, generations each took, best cost.
    """
    before = known(damage)
    if before is not None:
        return before
    found = _search(replace(experiments.damaged(damage, window=150), threads=2))
    _place(damage).parent.mkdir(parents=True, exist_ok=True)
    _place(damage).write_text(json.dumps(found))
    return found


def _search(config: RunConfig) -> dict[str, object]:
    from bns.run import make_world

    torch.set_num_threads(1)
    always = tuple(text.split("@")[0] for text in config.world.damage)
    world = make_world(replace(config, world=replace(config.world, damage=always)))
    config = replace(config, evolution=replace(config.evolution, population=POPULATION))
    encoding = Encoding.of(config.controller)
    task = NavigationTask.of(config.task)
    draws = Draws(seeding.integer(config.seed, "ceiling"))
    breeder = Breeder(config.evolution, encoding, False)
    population = encoding.random(RUNS, config.evolution.population, draws)
    rates = _rates(config)
    solved_at: list[int | None] = [None] * RUNS
    for generation in range(GENERATIONS):
        cost, goals = _in_world(world, encoding, task, population)
        for run in np.flatnonzero((goals == len(task.goals)).any(1)):
            solved_at[run] = solved_at[run] or generation + 1
        if all(solved_at):
            break
        coins = breeder.draw(RUNS, draws)
        population = breeder.breed(population, cost, rates, coins)
    return {
        "runs": RUNS,
        "solved": sum(at is not None for at in solved_at),
        "generations": solved_at,
        "best cost": [round(float(value), 1) for value in cost.min(1).values],
        "settings": asdict(config.evolution),
    }


def _rates(config: RunConfig) -> Rates:
    speed = metres_per_second(config.evolution.mutation_magnitude)
    size = [speed, speed, config.evolution.duration_magnitude]
    return Rates(
        torch.full((RUNS,), config.evolution.mutation_rate),
        torch.tensor([size] * RUNS),
    )


def _in_world(
    world, encoding: Encoding, task: NavigationTask, population: Population
) -> tuple[torch.Tensor, np.ndarray]:
    """Cost ``(R, P)`` and objectives reached of every individual, in the world."""
    runs, size = population.lengths.shape
    flat = Population(
        population.genes.flatten(0, 1)[:, None], population.lengths.flatten()[:, None]
    )
    trials = world.run(encoding.commands(flat), trial=0)
    cost, goals = score_trials(task, trials, encoding.max_commands)
    shape = (runs, size)
    return cost.float().view(shape), goals.view(shape).numpy()
