"""Batches of a learner on navigation, kept nowhere: what benches of rivals share."""

from dataclasses import replace
from typing import Any

import numpy as np

from bns import presets
from bns.experiment.batch import Batch
from bns.experiment.config import RunConfig
from bns.experiment.loading import with_learner
from bns.experiment.world_factory import make_models, make_world


def batch(config: RunConfig) -> Batch:
    """The runs of a configuration, each with a model of its own if it has a prior."""
    return Batch([config], [make_world(config)], models=make_models(config))


def columns(
    learner: str, *, runs: int, trials: int, **told: Any
) -> dict[str, np.ndarray]:
    """Figures of all trials, each ``(R, T)``; undamaged, unless told otherwise.

    Args:
        learner: its name.
        runs: R, replicates.
        trials: T.
        told: settings that differ.
    """
    base = presets.load("khepera-simple")
    base = replace(base, trials=trials, replicates=runs, threads=1)
    base = base if learner == "bns" else with_learner(base, learner)
    made = batch(base.with_({"world.damage": [], **told}))
    rows = [made.advance(trial)[0].columns for trial in range(trials)]
    names = set.intersection(*(set(row) for row in rows))
    return {name: np.array([row[name] for row in rows]).T for name in names}
