"""Rivals that think in simulator neural networks, as BNS does.

The static SNN is to transfer, and not to recover; PETS is to be about as quick as BNS
with as many evaluations inside the networks.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from bench.result import Result, bench
from bns import presets
from bns.experiment.batch import Batch
from bns.experiment.config import RunConfig
from bns.experiment.loading import with_learner
from bns.experiment.world_factory import make_world

SLOW = "wheel_gain:wheel=left,factor=0.8"
RUNS, AFTER = 10, 5
TRANSFERS, RECOVERS = 0.5, 0.1
PRETORIUS = {"settings.commands": 5000, "settings.trainings": 20}
"""commands of Pretorius et al. (2009)"""


def _columns(config: RunConfig) -> dict[str, np.ndarray]:
    """Figures of all trials of a batch, each ``(R, T)``."""
    batch = Batch([config], [make_world(config)])
    rows = [batch.advance(trial)[0].columns for trial in range(config.trials)]
    names = set.intersection(*(set(row) for row in rows))
    return {name: np.array([row[name] for row in rows]).T for name in names}


def _config(learner: str, *, runs: int, trials: int, **told: Any) -> RunConfig:
    base = presets.load("khepera-simple")
    base = replace(base, trials=trials, replicates=runs, threads=1)
    base = base if learner == "bns" else with_learner(base, learner)
    return base.with_({"world.damage": [], **told})


@bench(
    "runs of the static SNN whose transferred controller solves navigation, share",
    bar=">= 0.5 with 5,000 random commands, and <= 0.1 after the left wheel is 20 % "
    "slower",
)
def faithful_static_snn(quick: bool) -> Result:
    """`RUNS` runs, `AFTER` trials before the damage and after; quick: three, 360.

    The original reports that controllers transferred, and no share of them (thesis
    2.7); one half is this project's reading.
    """
    runs = 3 if quick else RUNS
    each = presets.load("khepera-simple").controller.max_commands
    told = {"settings.commands": 10 * each} if quick else PRETORIUS
    transfer = -(-told["settings.commands"] // each)
    onset = transfer + AFTER
    told = {**told, "world.damage": [f"{SLOW}@{onset}"]}
    trials = onset + AFTER
    seen = _columns(_config("static_snn", runs=runs, trials=trials, **told))
    solved = seen["solved"]
    share, after = solved[:, transfer:onset].mean(), solved[:, onset:].mean()
    return Result(
        figure=round(float(share), 4),
        unit="1",
        holds=None if quick else bool(share >= TRANSFERS and after <= RECOVERS),
        n=runs,
        details={
            "random trials": transfer,
            "solved after the damage": round(float(after), 4),
            "objectives reached by each run": seen["reached"][:, transfer].tolist(),
            "error of a command's turn [rad]": {
                "undamaged": round(float(seen["snn_turn"][:, transfer].mean()), 4),
                "last trial": round(float(seen["snn_turn"][:, -1].mean()), 4),
            },
        },
    )


MOST, TIMES = 30, 1.5


@bench(
    "trials until PETS has solved navigation, over those of BNS (medians)",
    bar="<= 1.5 x, about as many evaluations inside the networks",
)
def faithful_pets(quick: bool) -> Result:
    """`RUNS` undamaged runs of `MOST` trials each; quick: 3 of 10 trials."""
    runs, trials = (3, 10) if quick else (RUNS, MOST)
    found = {}
    for learner in ("pets", "bns"):
        solved = _columns(_config(learner, runs=runs, trials=trials))["solved"]
        first = np.where(solved.any(1), solved.argmax(1) + 1, trials + 1)
        found[learner] = {
            "trials until solved": first.tolist(),
            "median": float(np.median(first)),
            "solved, last ten trials": round(float(solved[:, -10:].mean()), 4),
        }
    figure = found["pets"]["median"] / found["bns"]["median"]
    known = found["pets"]["median"] <= trials
    return Result(
        figure=round(figure, 3),
        unit="x",
        holds=None if quick else bool(known and figure <= TIMES),
        n=runs,
        details={**found, "never": trials + 1},
    )
