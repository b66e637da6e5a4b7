"""The experiments that several benches share: each is run once, resumable, and kept.

Runs lie in `runs/bench/<name>-<key>/`, the key being that of the configuration, so a
changed default makes a new run. Two workers with one thread each train them. What the
benches of solving and recovering print of a record stands here as well.
"""

import json
import os
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, replace
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from bench.versions import ROOT
from bns import presets, stats
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.record import RunRecord
from bns.learners.bns.config import AdaptationConfig
from bns.tasks import registry as tasks

RUNS = ROOT / "runs" / "bench"
WORKERS = 2
ONSET = 30  # trial of the damage (dissertation, section 4.3.1)
REPLICATES = 30
DAMAGES = {
    "left-20": "wheel_gain:wheel=left,factor=0.8",
    "right-20": "wheel_gain:wheel=right,factor=0.8",
    "left-50": "wheel_gain:wheel=left,factor=0.5",
    "right-50": "wheel_gain:wheel=right,factor=0.5",
}
LATER = ("learner", "light", "walk", "watch", "deploy")
"""settings and sections newer than the first stored runs"""
NEWER = (
    ("adaptation", "simulator_reset_untrained"),
    ("evolution", "cells"),
    ("light", "readings"),
    ("light", "renewed"),
    ("walk", "anchors"),
    ("walk", "coxa_reach"),
    ("walk", "grow_from"),
    ("walk", "grow_until"),
    ("walk", "lost_legs"),
    ("walk", "nominal"),
    ("walk", "passes"),
    ("walk", "pull"),
    ("walk", "repeat"),
    ("walk", "repeat_after"),
    ("watch", "forget_floor"),
)
"""settings newer than some stored runs of their sections"""
QUICK = {"replicates": 6, "trials": 12}


def undamaged(problem: str, world: str = "mujoco") -> RunConfig:
    """The preset of a problem, without damage."""
    config = presets.load(f"khepera-{problem}")
    trials = 30 if problem == "simple" else 60
    return named(
        replace(config, trials=trials, world=WorldConfig(name=world)),
        f"{problem}-{world}",
    )


def damaged(damage: str, *, world: str = "mujoco", **adaptation: object) -> RunConfig:
    """The simple problem with one of `DAMAGES` from trial 30 on.

    Args:
        damage: key of `DAMAGES`.
        world: name of the world.
        adaptation: fields of `AdaptationConfig`.
    """
    config = replace(
        presets.load("khepera-simple"),
        trials=100,
        adaptation=AdaptationConfig(**adaptation),
        world=WorldConfig(name=world, damage=(f"{DAMAGES[damage]}@{ONSET}",)),
    )
    words = [f"{key}={value}" for key, value in sorted(adaptation.items())]
    return named(config, "-".join([damage, world, *words]))


def named(config: RunConfig, name: str) -> RunConfig:
    """The configuration with a seed of its own, from its name."""
    seed = int.from_bytes(sha256(name.encode()).digest()[:4], "little")
    return replace(
        config,
        preset=name,
        seed=seed,
        replicates=REPLICATES,
        record_replicates=0,
        threads=1,
        compiled="auto",
    )


def directory(config: RunConfig) -> Path:
    """Where a configuration's run is kept."""
    settings, plain = known(config), known(RunConfig())
    for name in LATER:  # unchanged, they are as good as not there
        if settings[name] == plain[name]:
            del settings[name]
    if not settings["adaptation"]["extra"]:
        del settings["adaptation"]["extra"]
    text = json.dumps(settings, sort_keys=True)
    return RUNS / f"{config.preset}-{sha256(text.encode()).hexdigest()[:8]}"


def known(config: RunConfig) -> dict[str, Any]:
    """A configuration as plain values, without newer settings that change nothing."""
    settings, plain = asdict(config), RunConfig()
    kind = tasks.kind(config.task.name)
    del settings["prior"], settings["settings"]  # of other learners
    settings["learner"] = kind  # as stored runs have it
    if kind != "navigation":
        settings["task"]["name"] = plain.task.name
    for section, name in NEWER:
        if settings[section][name] == getattr(getattr(plain, section), name):
            del settings[section][name]
    if not config.watch.detect:
        for name in ("floor", "grow", "reach", "near", "largest"):
            del settings["watch"][name]
    if not config.watch.forget or kind == "walk":
        settings["watch"]["forget_factor"] = 3.0  # does nothing; as stored runs have it
    return settings


def records(
    configs: Iterable[RunConfig], *, quick: bool = False
) -> Mapping[str, RunRecord]:
    """Records by configuration name, training what is missing.

    Args:
        configs: made by `undamaged` or `damaged`.
        quick: few replicates and trials, for a look that takes seconds.
    """
    wanted = list(configs)
    if quick:
        wanted = [shortened(config) for config in wanted]
    RUNS.mkdir(parents=True, exist_ok=True)
    with pool_of_workers() as pool:
        waiting = {pool.submit(_train, config): config for config in wanted}
        for done in as_completed(waiting):
            done.result()
    from bns.storage.store import load

    return {config.preset: load(directory(config)) for config in wanted}


def pool_of_workers() -> ProcessPoolExecutor:
    """Processes that work side by side, `WORKERS` of them."""
    return ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn"))


def shortened(
    config: RunConfig,
    sizes: Mapping[str, int] = QUICK,
    *,
    epochs: int = 100,
    **evolution: int,
) -> RunConfig:
    """A configuration with few replicates and trials.

    Args:
        config: whose damage sets in half-way.
        sizes: fields of the configuration: trials and replicates.
        epochs: of training, at most.
        evolution: settings of the section `evolution`.
    """
    onset = sizes["trials"] // 2
    damage = tuple(f"{text.rpartition('@')[0]}@{onset}" for text in config.world.damage)
    few = {"population": 50, "generations": min(config.evolution.generations, 30)}
    return replace(
        config,
        **sizes,
        evolution=replace(config.evolution, **few | evolution),
        snn=replace(config.snn, epochs=min(config.snn.epochs, epochs)),
        world=replace(config.world, damage=damage),
        compiled="no",
    )


def _train(config: RunConfig) -> None:
    os.environ["OMP_NUM_THREADS"] = "1"
    from bns.experiment.run import train

    train(config, directory(config), resume=True)


def waits(values: np.ndarray) -> dict[str, object]:
    """Waiting times as figures: how many came, median, interval, longest.

    Args:
        values: trials, ``(R,)``; inf = never.
    """
    middle = stats.median_interval(values)
    come = np.isfinite(values)
    return {
        "came": int(come.sum()),
        "of": len(values),
        "median": plain(middle.value),
        "interval": [plain(middle.low), plain(middle.high)],
        "longest": plain(values[come].max()) if come.any() else None,
    }


def first(hit: np.ndarray) -> np.ndarray:
    """Number of the first trial that did it, counted from 1; inf = none, ``(R,)``."""
    return np.where(hit.any(1), hit.argmax(1) + 1.0, np.inf)


def solved_within(record: RunRecord, limit: int) -> int:
    """Runs that reached all objectives within `limit` trials."""
    return int((stats.trials_to_solve(record) <= limit).sum())


def recovered_within(record: RunRecord, limit: int) -> int:
    """Runs that reached all objectives within `limit` trials from the damage on."""
    return int((stats.trials_to_recover(record) <= limit).sum())


def versus(a: RunRecord, b: RunRecord) -> dict[str, object]:
    """O (eq 3.1: sum of the best controller's cost after damage) of two sides.

    Lower is better, so `better` is the share of pairs in which `a` is the lower one
    (1 - A12), with its interval.
    """
    first, second = stats.observation_after(a), stats.observation_after(b)
    share = stats.a12(second, first)
    return {
        "p": float(stats.mann_whitney(first, second)),
        "better": round(share.value, 4),
        "interval": [round(share.low, 4), round(share.high, 4)],
        "medians": [float(np.median(first)), float(np.median(second))],
    }


def ratio(first: np.ndarray, second: np.ndarray) -> dict[str, object]:
    """Median of one side over that of another, with its 95 % bootstrap interval.

    Args:
        first, second: values of two sides whose runs belong together, each ``(R,)``:
            pairs are drawn.
    """
    from scipy.stats import bootstrap

    def medians(one: np.ndarray, other: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.median(one, axis=axis) / np.median(other, axis=axis)

    drawn = bootstrap((first, second), medians, paired=True, method="percentile", rng=0)
    ends = drawn.confidence_interval
    return {
        "ratio": round(float(medians(first, second)), 4),
        "ratio interval": [round(float(ends.low), 4), round(float(ends.high), 4)],
    }


def plain(value: float) -> float | None:
    """A number for JSON; None for never."""
    return float(value) if np.isfinite(value) else None
