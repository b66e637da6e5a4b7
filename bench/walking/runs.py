"""The walking experiments that several benches share (investigation D).

Undamaged runs come in groups of ten; the runs of each damage begin as copies of such a
group after its last trial, since up to there nothing differs (`trunks.forked`).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import torch

from bench.learning import experiments, trunks
from bns import presets
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.learners.bns.change_detection import changed
from bns.learners.bns.walking import MOVED, goal_inputs
from bns.storage.store import RunStore
from bns.worlds.trial import Trial, body_displacements

Kind = Literal["window", "forget", "own", "nominal"]  # of recovering, see `damaged`
ONSET = 100  # trial of the damage (dissertation, table 7.4)
AFTER = 50  # trials from the damage on: more than the latest bar
GROUPS = ("a", "b", "c")
GROUP = 10  # runs of a batch
RECOVERING: Mapping[Kind, Sequence[str]] = {
    "window": GROUPS[:1],
    "forget": GROUPS[:1],
    "own": GROUPS,
    "nominal": GROUPS[:1],
}
"""groups that are damaged"""
OWN = "hexapod-nominal"  # the preset of the kind `nominal`, with trunks of its own
WINDOW = 300
TYPES = ("type0", "type1", "type3", "type2", "type5")
BEFORE = 10  # trials whose median distance is what the robot did before the damage
SHARE = 0.9  # of that distance = recovered
QUICK = {"replicates": 1, "trials": 12}


class Hand(NamedTuple):
    """What the best tripod gait made by hand does in eleven commands.

    Attributes:
        distance: how far it gets [m].
        seconds: how long that takes.
    """

    distance: float
    seconds: float


def undamaged(
    group: str = "",
    *,
    trials: int = ONSET,
    preset: str = "hexapod-walk",
    **walk: object,
) -> RunConfig:
    """A batch of a preset without damage.

    Args:
        group: one of `GROUPS`, or another name for other seeds.
        trials: of each run.
        preset: which.
        walk: settings of the section `walk` that differ.
    """
    config = presets.load(preset)
    config = replace(
        config,
        trials=trials,
        adaptation=replace(config.adaptation, window=WINDOW),
        walk=replace(config.walk, **walk),
        world=replace(config.world, damage=()),
    )
    words = [f"{key}={value}" for key, value in sorted(walk.items())]
    named = experiments.named(
        config, "-".join([preset.removeprefix("hexapod-"), group, *words])
    )
    return replace(named, replicates=GROUP)


def damaged(legs: str, group: str = "a", *, kind: Kind = "window") -> RunConfig:
    """A batch of the preset whose legs are raised from trial `ONSET` on.

    Args:
        legs: as the effect `leg_raised` takes them.
        group: of which undamaged batch it is the continuation.
        kind: with the window alone, forgetting by evidence besides, or as the presets
            `hexapod-recover` and `OWN` do (which forget as well).
    """
    trunk = _trunk(kind, group)
    damage = (f"leg_raised:legs={legs},blend=1@{ONSET}",)
    config = replace(
        trunk,
        preset=f"walk-{'' if kind == 'window' else f'{kind}-'}{legs}-{group}",
        trials=ONSET + AFTER,
        world=replace(trunk.world, damage=damage),
        watch=replace(trunk.watch, forget=kind != "window"),
    )
    if kind == "own":
        return replace(config, walk=presets.load("hexapod-recover").walk)
    return config


def _trunk(kind: Kind, group: str) -> RunConfig:
    return undamaged(group, preset=OWN if kind == "nominal" else "hexapod-walk")


def records(
    configs: Iterable[RunConfig], *, quick: bool = False
) -> Mapping[str, RunRecord]:
    """As `experiments.records`, with a look of its own that takes seconds."""
    return experiments.records([small(c) if quick else c for c in configs])


def walking(kind: Kind = "window", *, quick: bool = False) -> RunRecord:
    """All undamaged runs, trained where they are missing; quick: one small run.

    Args:
        kind: of which recovering they are the beginning.
        quick: see above.
    """
    groups = RECOVERING["own" if kind == "window" else kind][: 1 if quick else None]
    found = records((_trunk(kind, group) for group in groups), quick=quick)
    return joined(list(found.values()))


def adequate(record: RunRecord, hand: Hand) -> np.ndarray:
    """Trials that got as far as the tripod gait in the time it takes, ``(R, T)``."""
    return in_time(record, hand.seconds) >= hand.distance


def recovering(kind: Kind, *, quick: bool = False) -> Mapping[str, RunRecord]:
    """The runs of a kind and each damage of `TYPES`; quick: one small run of each.

    Raises:
        BnsError: to forget by evidence would have changed the undamaged runs.
    """
    groups = RECOVERING[kind]
    configs = {
        (legs, group): damaged(legs, group, kind=kind)
        for legs, group in product(TYPES, groups)
    }
    if not quick:
        sound = records(_trunk(kind, group) for group in groups)
        told = kind in ("forget", "own")  # the trunks were run without
        if told and any(forgets(record).any() for record in sound.values()):
            raise BnsError("Run the undamaged runs with watch.forget, too.")
        for (_, group), config in configs.items():
            trunks.begin(_trunk(kind, group), config, idle=("watch", "walk"))
    found = records(configs.values(), quick=quick)
    return {
        legs: joined([found[configs[legs, group].preset] for group in groups])
        for legs in TYPES
    }


def kept(legs: str) -> list[RunRecord]:
    """Finished runs of one damage, or of none (`"none"`); nothing is trained."""
    if legs == "none":
        configs = [undamaged(group) for group in GROUPS]
    else:
        configs = [damaged(legs, group) for group in RECOVERING["window"]]
    places = [_place(config) for config in configs]
    stores = [RunStore.open(place) for place in places if (place / "run.json").exists()]
    return [store.record() for store in stores if store.finished]


def joined(parts: list[RunRecord]) -> RunRecord:
    """Batches of one experiment as one record, in order."""
    first = parts[0]
    many = sum(part.replicates for part in parts)

    def together(name: str) -> np.ndarray:
        return np.concatenate([getattr(part, name) for part in parts])

    names = ("sent", "poses", "predicted", "damage_onset")
    return replace(
        first,
        config=replace(first.config, replicates=many),
        columns={
            n: np.concatenate([p.columns[n] for p in parts]) for n in first.columns
        },
        **{name: together(name) for name in names},
    )


def small(config: RunConfig) -> RunConfig:
    """One run of few trials with a small population and short training."""
    few = {"population": 60, "generations": 10, "tournament": 6}
    return experiments.shortened(config, QUICK, epochs=60, **few)


def trials_to_regain(record: RunRecord) -> np.ndarray:
    """Trials from the damage until the robot got as far as `SHARE` of before.

    Counted from 1 (the onset trial itself); before is the median of the last `BEFORE`
    undamaged trials. Shape ``(R,)``; inf = never.
    """
    onset = int(record.damage_onset[0])
    enough = SHARE * before(record)
    return experiments.first(record["distance"][:, onset:] >= enough[:, None])


def before(record: RunRecord) -> np.ndarray:
    """How far robots got before their damage, ``(R,)`` [m]; see `trials_to_regain`."""
    onset = int(record.damage_onset[0])
    return np.median(record["distance"][:, max(onset - BEFORE, 0) : onset], axis=1)


def by_hand() -> Hand:
    """The tripod gait in the undamaged world."""
    from bns.models.phantomx import gait

    trials = walked([gait.tripod()])
    return Hand(float(ways(trials)[0]), float(trials[0].times[-1]))


def walked(lists: Iterable[np.ndarray], *, damage: str = "") -> list[Trial]:
    """Trials of lists of goals, each ``(K, 18)`` [rad]; `damage`: an effect as text."""
    world, commands = standing_by(lists, damage=damage)
    return world.run(commands)


def standing_by(lists: Iterable[np.ndarray], *, damage: str = ""):
    """The world of `walked`, and its commands."""
    from bns import models
    from bns.worlds import registry
    from bns.worlds.trial import Channel, Commands

    world = registry.make("hexapod", damage=(f"{damage}@0",) if damage else ())
    channels = tuple(Channel(*item) for item in models.robot("phantomx").channels)
    limit = presets.load("hexapod-walk").walk.limit
    return world, [
        Commands(item, np.full(len(item), limit), channels) for item in lists
    ]


def ways(trials: Sequence[Trial]) -> np.ndarray:
    """How far trials got, as the learner counts it, ``(N,)`` [m]."""
    from bns.tasks import walk

    return walk.of_trials(trials)


def in_time(record: RunRecord, seconds: float) -> np.ndarray:
    """How far each trial got within a time, ``(R, T)`` [m].

    A trial that took longer counts in proportion, one that took less as it is.
    """
    return record["distance"] * np.minimum(1.0, seconds / record["seconds"])


def spread(values: np.ndarray) -> dict[str, float]:
    """Median and range over runs."""
    return {
        "median": round(float(np.median(values)), 4),
        "least": round(float(values.min()), 4),
        "most": round(float(values.max()), 4),
    }


def _place(config: RunConfig) -> Path:
    return experiments.directory(config)


def forgets(record: RunRecord) -> np.ndarray:
    """Whether a change of the robot would have been seen after a trial, ``(R, T)``.

    As long as it would not, runs with `watch.forget` are those without.
    """
    walk, window = record.config.walk, record.config.adaptation.window
    found = np.zeros(record.sent.shape[:2], dtype=bool)
    for run in range(record.replicates):
        goals = torch.from_numpy(record.sent[run].copy())
        seen = goal_inputs(goals).numpy().astype(np.float32)
        moved = body_displacements(record.poses[run]) / np.array(MOVED)
        for trial in range(record.trials):
            rows = [
                part[: trial + 1].reshape(-1, part.shape[-1])[-window:]
                for part in (seen, moved.astype(np.float32))
            ]
            found[run, trial] = changed(*rows, walk.commands) > 0
    return found
