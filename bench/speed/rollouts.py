"""Robot time that a second buys: inside the SNN, and in the physics."""

import time
from statistics import median
from typing import Any

import torch

from bench.result import Result, bench

POPULATION, PHYSICS = 3000, 30  # controllers a call: 30 runs of 100, one of each run


@bench(
    "robot time per second of the SNN's rollouts against that of the physics",
    bar="none: printed",
)
def rollouts(quick: bool) -> Result:
    """The same random controllers in both, one thread each, interleaved."""
    repeats = 3 if quick else 15
    evaluator, population, theta = _population()
    compiled = torch.compile(evaluator.judge, dynamic=False)
    world, commands = _world(evaluator, population)
    durations = population.genes[..., 2].sum().item()
    physics_durations = sum(item.duration for item in commands)
    inputs = evaluator.inputs(population)
    calls = {
        "SNN": lambda: evaluator.judge(theta, inputs, population.lengths),
        "SNN, compiled": lambda: compiled(
            theta, inputs, population.lengths, fused=True
        ),
        "physics": lambda: world.run(commands),
    }
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for repeat in range(repeats + 1):
        for name, call in calls.items():
            begin = time.perf_counter()
            call()
            if repeat:  # the first warms up, and compiles
                seconds[name].append(time.perf_counter() - begin)
    rate = {
        name: (physics_durations if name == "physics" else durations) / median(values)
        for name, values in seconds.items()
    }
    return Result(
        figure=round(rate["SNN, compiled"] / rate["physics"], 1),
        unit="x",
        holds=None,
        n=repeats,
        details={
            f"{name} [s of robot time per s]": round(r) for name, r in rate.items()
        },
    )


def _population() -> tuple[Any, Any, Any]:
    from bns.draws import Draws
    from bns.evolution.chromosome import Encoding
    from bns.experiment.config import RunConfig
    from bns.learners.bns.navigation import Evaluator
    from bns.snn.network import Scaling, Shape
    from bns.tasks.navigation import Route

    torch.set_num_threads(1)
    config, draws = RunConfig(), Draws(0)
    encoding, shape = Encoding.of(config.controller), Shape.of(config.snn)
    evaluator = Evaluator(encoding, Scaling.of(encoding), shape, Route.of(config.task))
    population = encoding.random(PHYSICS, POPULATION // PHYSICS, draws)
    return evaluator, population, shape.random(PHYSICS, draws)


def _world(evaluator: Any, population: Any) -> tuple[Any, list]:
    from bns.worlds import registry

    first = population.pick(torch.zeros(PHYSICS, dtype=torch.long))
    return registry.make("mujoco", threads=1), evaluator.encoding.commands(first)
