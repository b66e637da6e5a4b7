"""The walking experiments that several benches share (investigation D)."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bench import experiments
from bns.config import RunConfig
from bns.record import RunRecord

ONSET = 100  # trial of the damage (dissertation, table 7.4)
AFTER = 100  # trials from the damage on
SOLVING = 100  # trials of the undamaged experiment (7.4.2: about 100 for a gait)
WINDOW = 300
TYPES = ("type0", "type1", "type3", "type2", "type5")
BEFORE = 10  # trials whose median distance is what the robot did before the damage
SHARE = 0.9  # of that distance = recovered
QUICK = {"replicates": 1, "trials": 12}


def undamaged(*, trials: int = SOLVING, replicates: int = 0, **walk: object):
    """The preset without damage.

    Args:
        trials: of each run.
        replicates: runs; 0 = those of all experiments.
        walk: settings of the section `walk` that differ.
    """
    config = _preset()
    config = replace(
        config,
        trials=trials,
        walk=replace(config.walk, **walk),
        world=replace(config.world, damage=()),
    )
    words = [f"{key}={value}" for key, value in sorted(walk.items())]
    named = experiments.named(config, "-".join(["walk", *words]))
    return replace(named, replicates=replicates or named.replicates)


def damaged(legs: str, **adaptation: object) -> RunConfig:
    """The preset with legs raised from trial `ONSET` on.

    Args:
        legs: as the effect `leg_raised` takes them.
        adaptation: fields of `AdaptationConfig` that differ from the preset's.
    """
    config = _preset()
    damage = (f"leg_raised:legs={legs},blend=1@{ONSET}",)
    config = replace(
        config,
        trials=ONSET + AFTER,
        adaptation=replace(config.adaptation, **{"window": WINDOW} | adaptation),
        world=replace(config.world, damage=damage),
    )
    words = [f"{key}={value}" for key, value in sorted(adaptation.items())]
    return experiments.named(config, "-".join(["walk", legs, *words]))


def records(configs, *, quick: bool = False) -> Mapping[str, RunRecord]:
    """As `experiments.records`, with a look of its own that takes seconds."""
    return experiments.records([small(c) if quick else c for c in configs])


def small(config: RunConfig) -> RunConfig:
    """One run of few trials with a small population and short training."""
    onset = QUICK["trials"] // 2
    damage = tuple(f"{text.rpartition('@')[0]}@{onset}" for text in config.world.damage)
    evolution = replace(config.evolution, population=60, generations=10, tournament=6)
    return replace(
        config,
        **QUICK,
        evolution=evolution,
        snn=replace(config.snn, epochs=60),
        world=replace(config.world, damage=damage),
        compiled="no",
    )


def trials_to_regain(record: RunRecord) -> np.ndarray:
    """Trials from the damage until the robot got as far as `SHARE` of before.

    Counted from 1 (the onset trial itself); before is the median of the last `BEFORE`
    undamaged trials. Shape ``(R,)``; inf = never.
    """
    found = np.full(record.replicates, np.inf)
    for run, onset in enumerate(record.damage_onset):
        ways = record["distance"][run]
        before = np.median(ways[max(onset - BEFORE, 0) : onset])
        hit = np.flatnonzero(ways[onset:] >= SHARE * before)
        if len(hit):
            found[run] = hit[0] + 1
    return found


def _preset() -> RunConfig:
    from bns import presets

    return presets.load("hexapod-walk")
