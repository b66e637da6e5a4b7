"""What a closed loop costs beside the bare physics of the same cycles."""

import time
from statistics import median
from typing import Any

import numpy as np

from bench.result import Result

DOC = "closed-loop World.drive of 30 robots against bare mujoco.rollout of its cycles"
BAR = "<= 1.25 x"
LIMIT = 1.25
ROBOTS, CYCLES, THREADS = 30, 100, 2


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


def run(quick: bool) -> Result:
    """Median of interleaved ratios, in one process, over several kinds of damage.

    The bare call gets the controls that the closed loop sent, cycle by cycle, all
    robots that were not stopped in one call of `mujoco.rollout`, each from the state
    that the cycle before left it in. The figure is the worst case.
    """
    repeats = 3 if quick else 15
    cases = {
        "undamaged": [()] * ROBOTS,
        "wheel_gain each": [
            (f"wheel_gain:wheel=left,factor={0.5 + 0.01 * i}",) for i in range(ROBOTS)
        ],
        "sensor_stuck_min each": [
            ("sensor_stuck_min:sensor=left",) for i in range(ROBOTS)
        ],
        "sensor_noise each": [
            (f"sensor_noise:factor={1 + 0.1 * i}",) for i in range(1, ROBOTS + 1)
        ],
        "payload each": [(f"payload:mass={0.01 * (i + 1)}",) for i in range(ROBOTS)],
    }
    figures = {
        name: round(median(_ratios(damage, repeats)), 4)
        for name, damage in cases.items()
    }
    worst = max(figures.values())
    return Result(
        figure=worst, unit="x", holds=worst <= LIMIT, n=repeats, details=figures
    )


def _ratios(damage: list, repeats: int) -> list[float]:
    from bns.worlds import registry

    world: Any = registry.make("light", damage=damage, threads=THREADS)
    policy, seeds = Networks(), range(ROBOTS)
    bare = _bare(world, policy, seeds)
    bare()
    ratios = []
    for _ in range(repeats):
        begin = time.perf_counter()
        bare()
        middle = time.perf_counter()
        world.drive(policy, cycles=CYCLES, seeds=seeds)
        ratios.append((time.perf_counter() - middle) / (middle - begin))
    return ratios


def _bare(world: Any, policy: Networks, seeds: range) -> Any:
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
