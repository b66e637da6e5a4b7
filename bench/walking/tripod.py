"""The hexapod's gait made by hand: what a walking learner has to beat."""

from itertools import product

import numpy as np

from bench.result import Result, bench

COMMANDS = 11
LIMIT = 1.5  # [s] of a command
STRIDES, LIFTS = (0.14, 0.16, 0.18), (0.045, 0.06)
REACHES, HEIGHTS = (0.12, 0.13, 0.14, 0.15), (0.12, 0.13, 0.14)


@bench(
    "distance of the tripod gait made by hand, eleven commands of the hexapod",
    bar="the farthest of a grid of such gaits",
)
def hexapod_tripod(quick: bool) -> Result:
    """`gait.BEST` against every gait of the grid that legs can reach.

    The figure is the distance of `gait.BEST` [m]; the bar holds where none of the grid
    goes more than 2 % farther without a fall or a collision of its own parts.
    """
    from bns.models.phantomx import gait

    grid = [gait.Tripod(*item) for item in product(STRIDES, LIFTS, REACHES, HEIGHTS)]
    gaits = [gait.BEST, *(grid[::30] if quick else grid)]
    trials = _walked(gaits)
    far = {
        item: float(np.hypot(*trial.poses_world[-1, :2]))
        for item, trial in trials.items()
        if not (trial.outcome.fell or trial.outcome.collided)
    }
    best, own = max(far, key=far.__getitem__), trials[gait.BEST]
    details = {
        "gait": dict(gait.BEST._asdict()),
        "end x, y [m], yaw [rad]": [round(float(v), 4) for v in own.poses_world[-1]],
        "seconds": round(float(own.times[-1]), 3),
        "metres per second": round(far[gait.BEST] / float(own.times[-1]), 4),
        "farthest": {**best._asdict(), "distance": round(far[best], 4)},
        "median of the grid": round(float(np.median(list(far.values()))), 4),
    }
    return Result(
        figure=round(far[gait.BEST], 4),
        unit="m",
        holds=far[best] <= 1.02 * far[gait.BEST],
        n=len(trials),
        details=details,
    )


def _walked(gaits: list) -> dict:
    """A trial of each gait that the legs can do."""
    from bns.errors import BnsError
    from bns.models.phantomx.gait import tripod
    from bns.worlds import registry
    from bns.worlds.trial import Channel, Commands

    world = registry.make("hexapod")
    channels = tuple(Channel(*item) for item in world.model.channels)
    done, lists = [], []
    for item in dict.fromkeys(gaits):
        try:
            goals = tripod(item, commands=COMMANDS)
        except BnsError:
            continue
        done.append(item)
        lists.append(Commands(goals, np.full(COMMANDS, LIMIT), channels))
    return dict(zip(done, world.run(lists), strict=True))
