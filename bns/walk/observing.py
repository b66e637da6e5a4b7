"""What a record keeps of a trial of walking."""

from collections.abc import Sequence

import numpy as np

from bns.experiment.config import WalkConfig
from bns.worlds.trial import Trial

CENTIMETRES = 100.0  # [cm/m] scores are in the dissertation's unit
FLAGS = ("fell", "collided", "overloaded", "overheated", "unrested")
"""of the outcome, each a column of 0 and 1"""


def distance(poses_world: np.ndarray) -> np.ndarray:
    """From the first to the last pose that was seen, along axis -2 [m].

    Args:
        poses_world: ``(..., K + 1, 3)``, NaN where lost; the first is known.

    Returns:
        ``(...,)``.
    """
    places = poses_world[..., :2]
    seen = np.isfinite(places).all(-1)
    last = places.shape[-2] - 1 - seen[..., ::-1].argmax(-1)
    end = np.take_along_axis(places, last[..., None, None], axis=-2)[..., 0, :]
    return np.hypot(*np.moveaxis(end - places[..., 0, :], -1, 0))


def cost(ways: np.ndarray) -> np.ndarray:
    """Fitness, lower is better: the square of distances [m], its sign turned [cm2].

    Its sum over the trials after damage is equation 7.4, the sign turned.
    """
    return -((CENTIMETRES * ways) ** 2)


def of_trials(trials: Sequence[Trial]) -> np.ndarray:
    """How far N robots got, ``(N,)`` [m]; one whose physics diverged got nowhere."""
    ways = distance(np.stack([trial.command_poses_world for trial in trials]))
    good = [trial.outcome.usable for trial in trials]
    return np.where(good, np.nan_to_num(ways), 0.0)


def measured(
    tried: Sequence[Trial], best: Sequence[Trial] | None, walk: WalkConfig
) -> dict[str, np.ndarray]:
    """Figures and arrays of a trial of every run.

    Args:
        tried: of the controllers tried.
        best: of the population's best, where they are others.
        walk: says what is adequate.

    Returns:
        fitness: see `cost`, ``(R,)`` [cm2].
        fitness_best: the same of the population's best.
        distance: of the controller tried [m].
        solved, reached: 1 where it got far enough (and did not fall, if that counts).
        seconds: what the trial took [s].
        commands: how many.
        fell, collided, overloaded, overheated, unrested: 0 or 1.
        sent: goals ``(R, K, C)`` [rad].
        poses: ``(R, K + 1, 3)`` [m, m, rad].
    """
    ways = of_trials(tried)
    others = ways if best is None else of_trials(best)
    flags = {
        name: np.array([float(getattr(trial.outcome, name)) for trial in tried])
        for name in FLAGS
    }
    solved = (ways >= walk.adequate) * (1.0 - flags["fell"] * walk.upright)
    return {
        "fitness": cost(ways),
        "fitness_best": cost(others),
        "distance": ways,
        "solved": solved,
        "reached": solved,
        "seconds": np.array([float(t.times[-1] - t.times[0]) for t in tried]),
        "commands": np.array([float(len(trial.commands)) for trial in tried]),
        **flags,
        "sent": np.stack([trial.commands.values for trial in tried]),
        "poses": np.stack([trial.command_poses_world for trial in tried]),
    }
