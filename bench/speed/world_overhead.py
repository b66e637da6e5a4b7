"""What `World.run` costs beside the bare physics call it is built on."""

import time
from statistics import median
from typing import Any

import numpy as np

from bench.result import Result, bench

LIMIT = 1.10
ROBOTS, COMMANDS, THREADS = 30, 12, 2
STEP = 0.005  # [s]


@bench(
    "World.run of 30 robots against bare mujoco.rollout, same models and controls",
    bar="<= 1.10 x",
)
def world_overhead(quick: bool) -> Result:
    """Median of interleaved ratios, in one process.

    Three worlds: undamaged, every robot with its own wheel gain (a signal effect), and
    every robot with its own payload (a model of its own). The figure is the worst. All
    lists last as long, so that the bare call needs no padding.
    """
    repeats = 5 if quick else 25
    cases = {
        "undamaged": [()] * ROBOTS,
        "wheel_gain each": [
            (f"wheel_gain:wheel=left,factor={0.5 + 0.01 * i}",) for i in range(ROBOTS)
        ],
        "payload each": [(f"payload:mass={0.01 * (i + 1)}",) for i in range(ROBOTS)],
    }
    ratios = {name: _ratios(damage, repeats) for name, damage in cases.items()}
    details = {name: round(median(values), 4) for name, values in ratios.items()}
    details["lists of 4 to 20 commands, against padding"] = round(
        median(_ratios([()] * ROBOTS, repeats, ragged=True)), 4
    )
    worst = max(median(values) for values in ratios.values())
    return Result(
        figure=round(worst, 4),
        unit="x",
        holds=worst <= LIMIT,
        n=repeats,
        details=details,
    )


def _ratios(damage: list, repeats: int, *, ragged: bool = False) -> list[float]:
    from bns.worlds import registry

    world: Any = registry.make("mujoco", damage=damage, threads=THREADS)
    commands = _commands(ragged)
    bare = _bare(world, commands)
    world.run(commands)
    bare()
    ratios = []
    for _ in range(repeats):
        begin = time.perf_counter()
        bare()
        middle = time.perf_counter()
        world.run(commands)
        ratios.append((time.perf_counter() - middle) / (middle - begin))
    return ratios


def _commands(ragged: bool) -> list:
    from bns.worlds.trial import Commands

    rng = np.random.default_rng(0)
    lists = []
    for _ in range(ROBOTS):
        count = int(rng.integers(4, 21)) if ragged else COMMANDS
        whole = rng.integers(60, 421, count) if ragged else rng.permutation(SPREAD)
        speeds = rng.uniform(-0.12, 0.12, (count, 2))
        lists.append(Commands(speeds, whole * STEP))
    return lists


# [steps] 12 durations of 1.2 s on average, in a different order for each robot
SPREAD = np.linspace(60, 420, COMMANDS).astype(int)


def _bare(world: Any, commands: list) -> Any:
    """The plain call: all robots at once, padded to the longest, results kept."""
    import mujoco
    from mujoco.rollout import Rollout

    jobs = [plan.job for plan in world.plan(commands)]
    models = [job.segments[0].compiled.model for job in jobs]
    controls = [job.segments[0].control for job in jobs]
    longest = max(len(control) for control in controls)
    control = np.zeros((len(jobs), longest, controls[0].shape[1]))
    for row, values in zip(control, controls, strict=True):
        row[: len(values)] = values
    start = np.stack([job.start for job in jobs])
    data = [mujoco.MjData(models[0]) for _ in range(THREADS)]
    roller = Rollout(nthread=THREADS)
    return lambda: roller.rollout(models, data, start, control)
