"""How models drive: what a time step costs the hexapod, and how near the Khepera is."""

import time
from typing import Any

import numpy as np

from bench.result import Result, bench

LIMIT = 0.01
HOLD = 0.6  # [s] of a command; fixed here, so that all ways see the same goals
FINEST = (0.0005, "elliptic", 10.0)
WAYS = (
    (0.002, "elliptic", 10.0),
    (0.004, "elliptic", 3.0),
    (0.005, "elliptic", 3.0),
    (0.008, "elliptic", 3.0),
    (0.002, "pyramidal", 10.0),
    (0.004, "pyramidal", 1.0),
    (0.008, "pyramidal", 1.0),
)
"""step [s], cone, impratio"""


@bench(
    "end of a hexapod's trial against that at 0.5 ms steps, by step and friction cone",
    bar="tripod's distance within 1 %",
)
def hexapod_step(quick: bool) -> Result:
    """The model's own way against the finest, and other ways beside it.

    Lists: the tripod gait, and random goals within 0.5 rad; goals as ramps.
    """
    lists = _lists(2 if quick else 12)
    finest = (0.001, *FINEST[1:]) if quick else FINEST
    exact, _ = _ends(lists, *finest)
    details: dict[str, object] = {}
    own = np.nan
    for step, cone, impratio in WAYS[1::4] if quick else WAYS:
        ends, cost = _ends(lists, step, cone, impratio)
        off = np.hypot(*(ends - exact)[:, :2].T)
        tripod = np.hypot(*ends[0, :2]) / np.hypot(*exact[0, :2]) - 1
        if (step, cone) == _own():
            own = abs(float(tripod))
        details[f"{step * 1e3:g} ms {cone}"] = {
            "mm off, median": round(float(np.median(off[1:])) * 1e3, 2),
            "tripod's distance": f"{tripod:+.2%}",
            "ms of processor time per second": round(cost * 1e3, 2),
        }
    moved = float(np.hypot(*exact[1:, :2].T).mean()) * 1e3
    details["mm moved, mean"] = round(moved, 1)
    return Result(
        figure=round(own, 4),
        unit="1",
        holds=own <= LIMIT,
        n=len(lists),
        details=details,
    )


def _own() -> tuple[float, str]:
    from bns import models

    option = models.spec("phantomx").option
    return float(option.timestep), "elliptic" if option.cone else "pyramidal"


def _lists(count: int) -> np.ndarray:
    from bns.models.phantomx import gait

    rng = np.random.default_rng(0)
    random = rng.uniform(-0.5, 0.5, (count, 11, 18))
    return np.concatenate([gait.tripod()[None], random])


def _ends(lists: np.ndarray, step: float, cone: str, impratio: float) -> Any:
    """Poses at the end (x, y) [m], shape ``(N, 2)``; processor time per second."""
    import mujoco
    from mujoco.rollout import Rollout

    from bns import models
    from bns.worlds.physics import control, legged_plan
    from bns.worlds.physics.legged_world import SPEED
    from bns.worlds.physics.rollout import Compiled

    spec = models.spec("phantomx", visuals=False)
    spec.option.timestep, spec.option.impratio = step, impratio
    spec.option.cone = getattr(mujoco.mjtCone, f"mjCONE_{cone.upper()}")
    scene = Compiled(spec.compile())
    held = round(HOLD / step)
    goals = [
        control.ramps(np.repeat(item, held, axis=0), np.zeros(18), SPEED * step)
        for item in lists
    ]
    start = legged_plan.stand(scene, (0.0, 0.0, 0.0), np.zeros(18).tobytes())
    begin = time.process_time()
    ends = [
        Rollout().rollout([scene.model], [scene.take()], start[None], item[None])
        for item in goals
    ]
    used = time.process_time() - begin
    places = np.array([states[0, -1, 1:3] for states, _ in ends])
    return places, used / (len(lists) * lists.shape[1] * HOLD)


@bench(
    "largest deviation of the Khepera's four calibration figures from the robot's",
    bar="<= 100 % of what is allowed (3 % speed and spin, 10 % starting losses)",
)
def khepera_calibration(quick: bool) -> Result:
    """Drive straight and spin from rest; quick changes nothing, it takes a second."""
    from bns import models
    from bns.models import khepera3

    measured = khepera3.measure(models.spec("khepera3"))
    shares = khepera3.deviations(measured)
    worst = 100 * max(shares.values())
    return Result(
        figure=round(worst, 2),
        unit="% of what is allowed",
        holds=worst <= 100,
        n=len(shares),
        details={
            "measured": measured._asdict(),
            "target": {k: float(v) for k, v in khepera3.TARGET._asdict().items()},
            "deviation_percent": {
                name: round(100 * share * getattr(khepera3.TOLERANCE, name), 3)
                for name, share in shares.items()
            },
            "units": "speed m/s, spin rad/s, lost_distance m, lost_angle rad",
        },
    )
