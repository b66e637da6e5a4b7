"""What the walking robots' `World.run` costs beside the bare physics calls."""

import time
from concurrent.futures import ThreadPoolExecutor
from statistics import median
from typing import Any

import numpy as np

from bench.result import Result, bench

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
