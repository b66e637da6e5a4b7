"""What learners cost: a trial, a batch, a run that walks, robot time inside the SNN."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np
import torch

from bench.result import Result, bench
from bench.speed.overhead import interleaved
from bench.walking import runs
from bns import presets
from bns.experiment.config import RunConfig

LIMIT = 1.5
THREADS = 2


@bench(
    "learner time against bare physics time of the same trials, window 150",
    bar="<= 1.5 x",
)
def learner_cost(quick: bool) -> Result:
    """30 runs x 100 trials of `khepera-simple`, start-up and compilation included.

    The bare physics are the rollouts of the very same trials, trial by trial in
    between, each robot to its own end (no padding); quick: 30 runs x 8 trials, without
    the start-up, which would need the 100 to pay.
    """
    trials = 8 if quick else 100
    with_window = measure(_config(150, trials), after=2 if quick else 0)
    print(f"window 150: {with_window}")  # the rest takes long
    details = {"window 150": with_window}
    if not quick:
        details["no window"] = measure(_config(0, trials))
    ratio = with_window["ratio without start-up" if quick else "ratio"]
    return Result(
        figure=ratio,
        unit="x",
        holds=None if quick else ratio <= LIMIT,
        n=trials * 30,
        details=details,
    )


def _config(window: int, trials: int) -> RunConfig:
    config = presets.load("khepera-simple")
    return replace(
        config,
        trials=trials,
        threads=THREADS,
        compiled="yes",
        adaptation=replace(config.adaptation, window=window),
    )


def measure(config: RunConfig, after: int = 0) -> dict[str, float]:
    """Seconds of learner, of bare physics, and their ratio.

    Args:
        config: the batch.
        after: trials not counted in "without start-up" beside the first one.
    """
    from bns.experiment.batch import Batch, resolve
    from bns.experiment.world_factory import make_world
    from bns.worlds.physics.rollout import Pool

    begin = time.perf_counter()
    config, _ = resolve(config)
    world = make_world(config)
    batch = Batch([config], [world])
    learner, starting = batch.learner, time.perf_counter() - begin
    pool = Pool(config.threads)
    learning, physics = [], []
    for trial in range(config.trials):
        marks = [time.perf_counter()]
        tried = learner.propose(trial).tried
        marks.append(time.perf_counter())
        jobs = [plan.job for plan in world.plan(tried, trial=trial)]
        marks.append(time.perf_counter())
        pool.map(jobs)
        marks.append(time.perf_counter())
        seen = world.run(tried, trial=trial)
        marks.append(time.perf_counter())
        learner.observe(trial, seen, None)
        marks.append(time.perf_counter())
        learning.append(marks[1] - marks[0] + marks[5] - marks[4])
        physics.append(marks[3] - marks[2])
    steady = [
        a / b for a, b in zip(learning[1 + after :], physics[1 + after :], strict=True)
    ]
    total = starting + sum(learning)
    return {
        "learner [s]": round(total, 2),
        "physics [s]": round(sum(physics), 2),
        "ratio": round(total / sum(physics), 3),
        "ratio without start-up": round(median(steady), 3),
    }


BATCH_LIMIT = 0.4
BATCH = 30


@bench("learner time per run: 30 in a batch against 1 alone, per trial", bar="<= 0.4 x")
def batch_cost(quick: bool) -> Result:
    """The same preset as a batch of 1 and of 30, both compiled, trials interleaved."""
    trials, warm = (6, 3) if quick else (25, 5)
    sizes = (1, BATCH) if quick else (1, 3, 10, BATCH)
    runs = {size: simple(size) for size in sizes}
    seconds: dict[int, list[float]] = {size: [] for size in sizes}
    for trial in range(trials):
        for size, (batch, world) in runs.items():
            seconds[size].append(_trial(batch, world, trial) / size)
    cost = {size: values[warm:] for size, values in seconds.items()}
    pairs = zip(cost[BATCH], cost[1], strict=True)
    ratio = median(many / alone for many, alone in pairs)
    return Result(
        figure=round(ratio, 4),
        unit="x",
        holds=ratio <= BATCH_LIMIT,
        n=trials - warm,
        details={
            f"ms per run and trial, batch of {size}": round(1e3 * median(values), 2)
            for size, values in cost.items()
        },
    )


def simple(size: int) -> tuple[Any, Any]:
    """A compiled batch of `khepera-simple` of so many runs, and its world."""
    from bns.experiment.batch import Batch, resolve
    from bns.experiment.world_factory import make_world

    config = presets.load("khepera-simple")
    config = replace(config, replicates=size, threads=THREADS, compiled="yes")
    config, _ = resolve(config)
    world = make_world(config)
    return Batch([config], [world]), world


def _trial(batch: Any, world: Any, trial: int) -> float:
    """Seconds the learner takes for one trial; the world's are left out."""
    begin = time.perf_counter()
    tried = batch.learner.propose(trial).tried
    proposed = time.perf_counter()
    seen = world.run(tried, trial=trial)
    ran = time.perf_counter()
    batch.learner.observe(trial, seen, None)
    return proposed - begin + time.perf_counter() - ran


POPULATION, PHYSICS = 3000, 30  # controllers a call: 30 runs of 100, one of each run


@bench(
    "robot time per second of the SNN's rollouts against that of the physics",
    bar="none: printed",
)
def rollouts(quick: bool) -> Result:
    """The same random controllers in both, one thread each, interleaved."""
    repeats = 3 if quick else 15
    torch.set_num_threads(1)
    evaluator = in_network()
    population, theta = drawn(evaluator)
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
    # the first of each warms up, and compiles
    seconds = interleaved(tuple(calls.values()), repeats + 1)[1:, :, 0]
    rate = {
        name: (physics_durations if name == "physics" else durations) / median(values)
        for name, values in zip(calls, seconds.T.tolist(), strict=True)
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


def in_network(device: str = "cpu") -> Any:
    """What judges controllers inside the default network, on a torch device."""
    from bns.evolution.chromosome import Encoding
    from bns.learners.bns.navigation import Evaluator
    from bns.snn.network import Scaling, Shape
    from bns.tasks.navigation import Route

    config = RunConfig()
    encoding, shape = Encoding.of(config.controller, device), Shape.of(config.snn)
    route = Route.of(config.task, device)
    return Evaluator(encoding, Scaling.of(encoding), shape, route)


def drawn(evaluator: Any) -> tuple[Any, Any]:
    """Random controllers of thirty runs, and each run's weights, on the processor."""
    from bns.draws import Draws

    draws = Draws(0)
    population = evaluator.encoding.random(PHYSICS, POPULATION // PHYSICS, draws)
    return population, evaluator.shape.random(PHYSICS, draws)


def _world(evaluator: Any, population: Any) -> tuple[Any, list]:
    from bns.worlds import registry

    first = population.pick(torch.zeros(PHYSICS, dtype=torch.long))
    return registry.make("mujoco", threads=1), evaluator.encoding.commands(first)


RUN_LIMIT = 10.0
TRIALS, WALKERS, SOME = 200, 6, 10


@bench(
    "processor time of one hexapod run of 200 trials, window 300",
    bar="<= 10 min on 2 cores",
)
def hexapod_run_cost(quick: bool) -> Result:
    """The preset, one run of 200 trials on two threads; quick: 12 small trials.

    Processor time, because it is the same on a busy machine: on a quiet one the run
    takes no longer than that. Beside it what a trial of a run costs alone and in a
    batch of six, over the first ten trials.
    """
    config = runs.damaged("1,5")
    config = replace(config, trials=TRIALS, replicates=1, threads=2)
    if quick:
        config = runs.small(config)
    whole = processor_times(config)
    details: dict[str, object] = {"one run": whole}
    if not quick:
        some = replace(config, trials=SOME, world=replace(config.world, damage=()))
        alone, many = (
            processor_times(some),
            processor_times(replace(some, replicates=WALKERS)),
        )
        details[f"one run, {SOME} trials"] = alone
        details[f"{WALKERS} runs, {SOME} trials"] = many
        details["share of a run's cost in a batch"] = round(
            many["processor [s]"] / WALKERS / alone["processor [s]"], 3
        )
    minutes = whole["processor [s]"] / 60
    return Result(
        figure=round(minutes, 3),
        unit="min",
        holds=None if quick else minutes <= RUN_LIMIT,
        n=config.trials,
        details=details,
    )


HALF, SOON = 0.5, 20  # of the world's processor time; trials


@bench(
    "processor time of learning over that of the same trials, light following, 30 runs",
    bar="<= 0.5 x",
)
def light_cost(quick: bool) -> Result:
    """`khepera-light`, 30 runs of 20 trials, one thread; quick: 2 runs of 2."""
    return _shared(presets.load("khepera-light"), quick=quick)


@bench(
    "processor time of learning over that of the same trials, walking, 30 runs",
    bar="<= 0.5 x",
)
def walk_cost(quick: bool) -> Result:
    """`hexapod-walk`, 30 runs of 20 trials, one thread; quick: 2 runs of 2."""
    return _shared(presets.load("hexapod-walk"), quick=quick)


def _shared(config: RunConfig, *, quick: bool) -> Result:
    """Evolution and training over the world, start-up and compilation left out."""
    count, trials = (2, 2) if quick else (BATCH, SOON)
    config = replace(config, replicates=count, trials=trials, threads=1)
    taken = processor_times(config)
    ratio = (taken["evolution [s]"] + taken["training [s]"]) / taken["world [s]"]
    return Result(
        figure=round(ratio, 3),
        unit="x",
        holds=None if quick else ratio <= HALF,
        n=count * trials,
        details=taken,
    )


def processor_times(config: RunConfig) -> dict[str, float]:
    """Seconds of evolution, world and training, start-up included in the total."""
    from bns.experiment.batch import Batch, resolve
    from bns.experiment.world_factory import make_world

    begun, wall = time.process_time(), time.perf_counter()
    config, mode = resolve(config)
    batch = Batch([config], [make_world(config)])
    taken = list(by_trial(batch, config.trials, time.process_time))
    kinds = zip(
        ("evolution", "world", "training"), zip(*taken, strict=True), strict=True
    )
    return {
        **{f"{kind} [s]": round(sum(seconds), 2) for kind, seconds in kinds},
        "processor [s]": round(time.process_time() - begun, 2),
        "wall [s]": round(time.perf_counter() - wall, 2),
        "compiled": mode == "compiled",
    }


def by_trial(
    batch: Any, trials: int, clock: Callable[[], float]
) -> Iterator[tuple[float, float, float]]:
    """Time that evolution, the world and training take, trial by trial.

    Args:
        batch: whose learner; no step of it is recorded.
        trials: how many.
        clock: what is read between them.
    """
    for trial in range(trials):
        marks = [clock()]
        proposal = batch.learner.propose(trial)
        marks.append(clock())
        seen = batch._execute(proposal.tried, trial, "world")
        marks.append(clock())
        batch.learner.observe(trial, seen, None)
        marks.append(clock())
        evolution, world, training = np.diff(marks).tolist()
        yield evolution, world, training
