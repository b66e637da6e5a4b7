"""What worlds cost beside their physics: on wheels, in closed loops, on legs."""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
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
    seconds = interleaved((bare, lambda: world.run(commands)), repeats)
    return (seconds[:, 1, 0] / seconds[:, 0, 0]).tolist()


def interleaved(calls: Sequence[Callable[[], Any]], repeats: int) -> np.ndarray:
    """Wall and processor time [s] of C calls, one after another, ``(R, C, 2)``."""
    seconds = np.zeros((repeats, len(calls), 2))
    for repeat in seconds:
        for row, each in zip(repeat, calls, strict=True):
            row -= time.perf_counter(), time.process_time()
            each()
            row += time.perf_counter(), time.process_time()
    return seconds


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


LOOP_LIMIT = 1.25
CYCLES = 50


class Networks:
    """Thirty feedforward networks, 2-5-2, evaluated as one batch."""

    def __init__(self):
        rng = np.random.default_rng(0)
        self.hidden = rng.uniform(-5, 5, (ROBOTS, 2, 5))
        self.bias = rng.uniform(-5, 5, (ROBOTS, 5))
        self.out = rng.uniform(-1, 1, (ROBOTS, 5, 2))

    def memory(self, n: int) -> np.ndarray:
        return np.zeros((n, 0))

    def act(self, readings: np.ndarray, memory: np.ndarray) -> tuple:
        inner = np.einsum("ns,nsh->nh", readings / 4095, self.hidden) + self.bias
        speeds = np.einsum("nh,nhc->nc", np.tanh(inner), self.out)
        return 0.12 * np.tanh(speeds), memory


@bench(
    "closed-loop World.drive of 30 robots against bare mujoco.rollout of its cycles",
    bar="<= 1.25 x",
)
def closed_loop_overhead(quick: bool) -> Result:
    """Median of interleaved ratios, in one process, over several kinds of damage.

    The bare call gets the controls that the closed loop sent, cycle by cycle, all
    robots that were not stopped in one call of `mujoco.rollout`, each from the state
    that the cycle before left it in. The figure is the worst case. Beside it stands
    the ratio of processor times, which says what is worked in addition; the wall clock
    also has the waiting of threads for each other, once a cycle, which a busy machine
    multiplies.
    """
    repeats = 2 if quick else 5
    cases = {
        "undamaged": [()] * ROBOTS,
        "wheel_gain each": [
            (f"wheel_gain:wheel=left,factor={0.5 + 0.01 * i}",) for i in range(ROBOTS)
        ],
        "sensor_gain each": [
            (f"sensor_gain:factor={0.5 + 0.01 * i}",) for i in range(ROBOTS)
        ],
        "sensor_noise each": [
            (f"sensor_noise:factor={1.5 + 0.1 * i}",) for i in range(ROBOTS)
        ],
        "payload each": [(f"payload:mass={0.01 * (i + 1)}",) for i in range(ROBOTS)],
    }
    details: dict[str, object] = {}
    worst = 0.0
    for name, damage in cases.items():
        wall, processor = np.median(_loop_ratios(damage, repeats), axis=0)
        details[name] = round(float(wall), 4)
        details[f"{name}, processor time"] = round(float(processor), 4)
        worst = max(worst, float(wall))
    details["load of the machine"] = round(os.getloadavg()[0], 1)
    return Result(
        figure=round(worst, 4),
        unit="x",
        holds=worst <= LOOP_LIMIT,
        n=repeats,
        details=details,
    )


def _loop_ratios(damage: list, repeats: int) -> np.ndarray:
    """Closed loop over bare call: wall clock and processor time, ``(R, 2)``."""
    from bns.worlds import registry

    world: Any = registry.make("light", damage=damage, threads=THREADS)
    policy, seeds = Networks(), range(ROBOTS)
    bare = _bare_loop(world, policy, seeds)
    bare()
    seconds = interleaved(
        (bare, lambda: world.drive(policy, cycles=CYCLES, seeds=seeds)), repeats
    )
    return seconds[:, 1] / seconds[:, 0]


def _bare_loop(world: Any, policy: Networks, seeds: range) -> Any:
    """Cycles of all robots at once, states kept."""
    import mujoco
    from mujoco.rollout import Rollout

    session = world.session(cycles=CYCLES, seeds=seeds)
    start = session.states[:, 0].copy()
    cycles = []
    while session.cycle < CYCLES:
        session.step(policy.act(session.readings, policy.memory(ROBOTS))[0])
        moved = session.segments.values()
        models = [segments[0].compiled.model for segments in moved]
        controls = np.stack([segments[0].control for segments in moved])
        cycles.append((list(session.segments), models, controls))
    data = [mujoco.MjData(models[0]) for _ in range(THREADS)]
    roller = Rollout(nthread=THREADS)

    def loop() -> None:
        states, kept = start.copy(), []
        for robots, models, control in cycles:
            moved, _ = roller.rollout(models, data, states[robots], control)
            states[robots] = moved[:, -1]
            kept.append(moved)

    return loop


HEXAPODS, STEPS = 12, 11  # robots, commands
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
        "undamaged": [()] * HEXAPODS,
        "leg_raised each": [
            (f"leg_raised:legs={1 + i % 6},blend=1",) for i in range(HEXAPODS)
        ],
        "payload each": [(f"payload:mass={0.01 * (i + 1)}",) for i in range(HEXAPODS)],
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
    commands = _walks(world)
    plans = world.plan(commands)
    walks = world.motions(plans)
    bare = _bare_walks(plans, walks)
    steps = sum(len(walk.control) for walk in walks)
    seconds = interleaved((bare, lambda: world.run(commands)), repeats + 1)[1:]
    wall, processor = np.median(seconds[:, 1] / seconds[:, 0], axis=0).tolist()
    return {
        "wall": wall,
        "processor": processor,
        "rate": float(np.median(steps / seconds[:, 1, 1])),
        "calls": sum(walk.calls for walk in walks) / (HEXAPODS * STEPS),
        "trial": steps * world.dt / HEXAPODS,
    }


def _walks(world: Any) -> list:
    from bns.worlds.trial import Channel, Commands

    rng = np.random.default_rng(0)
    channels = tuple(Channel(*item) for item in world.model.channels)
    goals = rng.uniform(-REACH, REACH, (HEXAPODS, STEPS, len(channels)))
    limits = np.full(STEPS, 1.5)  # [s]
    return [Commands(values, limits, channels) for values in goals]


def _bare_walks(plans: list, walks: list) -> Any:
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
