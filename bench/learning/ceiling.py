"""The ceiling: direct evolution in the damaged world, no SNN in between.

It starts from the best controllers that BNS tried there, so that minutes are enough;
from random ones, 60 generations of 60 individuals reached three of five objectives.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import torch

from bench.learning import experiments
from bench.result import Result, bench
from bns import seeding
from bns.draws import Draws
from bns.evolution.chromosome import Encoding, Population
from bns.evolution.generation import Breeder, Rates
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.experiment.task_settings import metres_per_second
from bns.tasks.navigation import Route, score_trials

RUNS, POPULATION, GENERATIONS = 1, 100, 12


@bench(
    "damages of four that direct evolution in the damaged world solves",
    bar="none: printed beside recover-window",
)
def ceiling(quick: bool) -> Result:
    """One direct evolution a damage; quick: what is known already, no new one.

    Needs the runs of `recover-window`, and trains them where they are missing.
    """
    names = [d for d in experiments.DAMAGES if not quick or known(d)]
    found = {damage: reached(damage) for damage in names}
    return Result(
        figure=sum(bool(row["solved"]) for row in found.values()),
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
        whether the damaged robot can solve the simple problem at all; the best cost
        [cm] that BNS came to there, and what direct evolution made of it; commands in
        its list.
    """
    before = known(damage)
    if before is not None:
        return before
    found = _search(replace(experiments.damaged(damage, window=150), threads=2))
    _place(damage).parent.mkdir(parents=True, exist_ok=True)
    _place(damage).write_text(json.dumps(found))
    return found


def _search(config: RunConfig) -> dict[str, object]:
    from bns.experiment.world_factory import make_world

    torch.set_num_threads(1)
    record = experiments.records([replace(config, threads=1)])[config.preset]
    always = tuple(text.split("@")[0] for text in config.world.damage)
    world = make_world(replace(config, world=replace(config.world, damage=always)))
    config = replace(config, evolution=replace(config.evolution, population=POPULATION))
    encoding = Encoding.of(config.controller)
    task = Route.of(config.task)
    draws = Draws(seeding.integer(config.seed, "ceiling"))
    breeder = Breeder(config.evolution, encoding, False)
    population = _tried(record, encoding)
    cost, goals = _in_world(world, encoding, task, population)
    begun = float(cost.min())
    rates = _rates(config)
    for _ in range(GENERATIONS):
        coins = breeder.draw(draws, rates)
        population = breeder.breed(population, cost, rates, coins)
        cost, goals = _in_world(world, encoding, task, population)
    best = int(cost[0].argmin())
    return {
        "solved": bool(goals[0, best] == len(task.goals)),
        "best cost by BNS [cm]": round(begun, 1),
        "best cost by direct evolution [cm]": round(float(cost[0, best]), 1),
        "commands": int(population.lengths[0, best]),
        "settings": asdict(config.evolution) | {"generations": GENERATIONS},
    }


def _tried(record: RunRecord, encoding: Encoding) -> Population:
    """The best controllers that BNS tried on the damaged robot, as genes.

    A stop becomes the lowest speed gene, which means a stop as well.
    """
    onset = int(record.damage_onset[0])
    cost = record["fitness"][:, onset:]
    runs, trials = np.unravel_index(np.argsort(cost, axis=None), cost.shape)
    sent = record.sent[runs[:POPULATION], trials[:POPULATION] + onset]
    lengths = np.isfinite(sent[..., 2]).sum(1)
    genes = torch.from_numpy(np.nan_to_num(sent).astype(np.float32))
    made = Population(genes[None], torch.from_numpy(lengths)[None])
    inside = torch.maximum(made.genes, encoding.low) * made.valid.unsqueeze(-1)
    return made._replace(genes=inside)


def _rates(config: RunConfig) -> Rates:
    speed = metres_per_second(config.evolution.mutation_magnitude)
    size = [speed, speed, config.evolution.duration_magnitude]
    return Rates(
        torch.full((RUNS,), config.evolution.mutation_rate),
        torch.tensor([size] * RUNS),
    )


def _in_world(
    world, encoding: Encoding, task: Route, population: Population
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
