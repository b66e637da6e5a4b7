"""What walking costs: the world beside its physics, and runs."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np

from bench.result import Result, bench
from bench.walking import runs
from bns.experiment.config import RunConfig

LIMIT = 1.10
ROBOTS, COMMANDS, THREADS = 12, 11, 2
REACH = 0.5  # [rad] goals around half-way, in which nothing falls


@bench(
    "World.run of 12 hexapods against bare mujoco.rollout, same models and controls",
    bar="<= 1.10 x",
)
def hexapod_overhead(quick: bool) -> Result:
    """Median of interleaved ratios of processor time, in one process.

    Processor time, because it is the same on a busy machine; ratios of wall time are
    among the details.

    The bare side makes one call per robot, without padding, on as many threads, with
    the goals in force that the world found; it knows nothing of arrival and rest.
    Three worlds: undamaged, every robot with a raised leg of its own, and every robot
    with its own payload (a model of its own). The figure is the worst.
    """
    repeats = 2 if quick else 9
    cases = {
        "undamaged": [()] * ROBOTS,
        "leg_raised each": [
            (f"leg_raised:legs={1 + i % 6},blend=1",) for i in range(ROBOTS)
        ],
        "payload each": [(f"payload:mass={0.01 * (i + 1)}",) for i in range(ROBOTS)],
    }
    found = {name: _measured(damage, repeats) for name, damage in cases.items()}
    worst = max(item["processor"] for item in found.values())
    sound = found["undamaged"]
    return Result(
        figure=round(worst, 4),
        unit="x",
        holds=worst <= LIMIT,
        n=repeats,
        details={
            **{name: round(item["processor"], 4) for name, item in found.items()},
            "wall time": {name: round(item["wall"], 4) for name, item in found.items()},
            "thousand steps per second of processor time": round(
                sound["rate"] / 1e3, 2
            ),
            "calls of the physics per command": round(sound["calls"], 2),
            "seconds of a trial": round(sound["trial"], 2),
        },
    )


def _measured(damage: list, repeats: int) -> dict[str, float]:
    """Medians of one case."""
    from bns.worlds import registry

    world: Any = registry.make("hexapod", damage=damage, threads=THREADS)
    commands = _commands(world)
    plans = world.plan(commands)
    walks = world.motions(plans)
    bare = _bare(plans, walks)
    seen: dict[str, list[float]] = {"wall": [], "processor": [], "rate": []}
    steps = sum(len(walk.control) for walk in walks)
    for _ in range(repeats + 1):
        plain, used = _timed(bare), _timed(lambda: world.run(commands))
        seen["wall"].append(used[0] / plain[0])
        seen["processor"].append(used[1] / plain[1])
        seen["rate"].append(steps / used[1])
    return {
        **{name: median(values[1:]) for name, values in seen.items()},
        "calls": sum(walk.calls for walk in walks) / (ROBOTS * COMMANDS),
        "trial": steps * world.dt / ROBOTS,
    }


def _timed(call: Any) -> tuple[float, float]:
    """Wall and processor time [s]."""
    wall, used = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - wall, time.process_time() - used


def _commands(world: Any) -> list:
    from bns.worlds.trial import Channel, Commands

    rng = np.random.default_rng(0)
    channels = tuple(Channel(*item) for item in world.model.channels)
    goals = rng.uniform(-REACH, REACH, (ROBOTS, COMMANDS, len(channels)))
    limits = np.full(COMMANDS, 1.5)  # [s]
    return [Commands(values, limits, channels) for values in goals]


def _bare(plans: list, walks: list) -> Any:
    """One plain call per robot: its model, its start, its goals in force."""
    import mujoco
    from mujoco.rollout import Rollout

    jobs = [
        (plan.job.pieces[0].compiled.model, plan.job.start[None], walk.control[None])
        for plan, walk in zip(plans, walks, strict=True)
    ]
    spare = [mujoco.MjData(model) for model, _, _ in jobs]
    pool = ThreadPoolExecutor(THREADS)

    def call(item: tuple) -> None:
        (model, start, control), data = item
        Rollout().rollout([model], [data], start, control)

    return lambda: list(pool.map(call, zip(jobs, spare, strict=True)))


RUN_LIMIT = 10.0
TRIALS, BATCH, SOME = 200, 6, 10


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
    whole = measure(config)
    details: dict[str, object] = {"one run": whole}
    if not quick:
        some = replace(config, trials=SOME, world=replace(config.world, damage=()))
        alone, many = measure(some), measure(replace(some, replicates=BATCH))
        details[f"one run, {SOME} trials"] = alone
        details[f"{BATCH} runs, {SOME} trials"] = many
        details["share of a run's cost in a batch"] = round(
            many["processor [s]"] / BATCH / alone["processor [s]"], 3
        )
    minutes = whole["processor [s]"] / 60
    return Result(
        figure=round(minutes, 3),
        unit="min",
        holds=None if quick else minutes <= RUN_LIMIT,
        n=config.trials,
        details=details,
    )


def measure(config: RunConfig) -> dict[str, float]:
    """Seconds of evolution, world and training, start-up included in the total."""
    from bns.experiment.batch import Batch, resolve
    from bns.experiment.world_factory import make_world

    begun, wall = time.process_time(), time.perf_counter()
    config, mode = resolve(config)
    batch = Batch([config], [make_world(config)])
    learner, kind = batch.learner, {"evolution": 0.0, "world": 0.0, "training": 0.0}
    for trial in range(config.trials):
        marks = [time.process_time()]
        proposal = learner.propose(trial)
        marks.append(time.process_time())
        seen = batch._execute(proposal.tried, trial, "world")
        marks.append(time.process_time())
        learner.observe(trial, seen, None)
        marks.append(time.process_time())
        for name, a, b in zip(kind, marks, marks[1:], strict=False):
            kind[name] += b - a
    return {
        **{f"{name} [s]": round(seconds, 2) for name, seconds in kind.items()},
        "processor [s]": round(time.process_time() - begun, 2),
        "wall [s]": round(time.perf_counter() - wall, 2),
        "compiled": mode == "compiled",
    }
