"""Runs that differ only from the damage on share the trials before it.

These are trained once, undamaged (the *trunk*); each side goes on from a copy. It is,
to the byte, what the side would be had it been trained from its first trial on, since
all sides of a trunk have its seed. All are kept as `experiments` keeps its runs.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from hashlib import sha256
from itertools import count
from pathlib import Path
from shutil import copytree, rmtree

import numpy as np

from bench.learning import experiments
from bench.learning.experiments import directory, known, pool_of_workers, shortened
from bns.campaign.trunk import ON_DAMAGE
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.learners.bns.config import AdaptationConfig


def trunk(config: RunConfig) -> RunConfig:
    """What a side is before its damage."""
    plain = AdaptationConfig()
    told = {name: getattr(plain, name) for name in ON_DAMAGE}
    adaptation = config.adaptation
    if not config.watch.detect:  # a false alarm sets them off as well
        adaptation = replace(adaptation, **told)
    return replace(
        config,
        preset="light-trunk",
        trials=onset(config) + 1,
        adaptation=adaptation,
        world=replace(config.world, damage=()),
    )


def seed(config: RunConfig) -> int:
    """The seed of all sides of a trunk."""
    settings = known(replace(trunk(config), seed=0, replicates=0))
    return int.from_bytes(sha256(repr(settings).encode()).digest()[:4], "little")


def onset(config: RunConfig) -> int:
    """First damaged trial of a side."""
    from bns.worlds.damage import Damage

    return Damage.parse(config.world.damage).first_trial


def forked(
    configs: Iterable[RunConfig], *, quick: bool = False
) -> Mapping[str, RunRecord]:
    """Records by configuration name, training what is missing; all with a damage.

    Args:
        configs: made by `bench.learning.light.damaged`.
        quick: few replicates and trials, for a look that takes seconds.
    """
    wanted = [shortened(c) if quick else c for c in configs]
    missing = [c for c in wanted if not (_place(c) / "run.json").exists()]
    trunks = {_place(trunk(config)): config for config in missing}
    experiments.RUNS.mkdir(parents=True, exist_ok=True)
    with pool_of_workers() as pool:
        list(pool.map(grow, trunks.values()))
        list(pool.map(branch, wanted))
    from bns.storage.store import load

    return {config.preset: load(_place(config)) for config in wanted}


def grow(config: RunConfig) -> None:
    """Train the trunk of a side as far as its damage."""
    from bns.experiment.run import train
    from bns.storage.store import RunStore

    base = trunk(config)
    place = _place(base)
    done = RunStore.open(place).read_state()[0] if place.exists() else 0
    asked = count(done)
    train(base, place, resume=True, stop=lambda: next(asked) >= onset(config))


def branch(config: RunConfig) -> None:
    """Train a side from its damage on."""
    from bns.experiment.run import train

    place = _place(config)
    if not (place / "run.json").exists():
        _copy(config, place)
    train(config, place, resume=True)


def _copy(config: RunConfig, place: Path) -> None:
    """The trunk as the beginning of a side; the damage is known or is not."""
    from bns.experiment.run import facts
    from bns.storage.store import RunStore

    source = RunStore.open(_place(trunk(config)))
    known = facts(config, source.mode)
    done, state = source.read_state()
    state["onsets"][:] = -1 if config.watch.detect else known["damage_onset"]
    part = place.with_name(f"{place.name}.part")
    rmtree(part, ignore_errors=True)
    store = RunStore(part, config, source.mode, source.versions, **_named(known))
    store.create()
    copytree(source.directory / "steps", part / "steps")
    store.write_state(done, state)
    store.close()
    part.rename(place)


def _named(known: Mapping[str, object]) -> dict[str, object]:
    return {name: known[name] for name in ("conditions", "damage_onset")}


def _place(config: RunConfig) -> Path:
    return directory(config)


def begin(trunk: RunConfig, branch: RunConfig, *, idle: tuple[str, ...] = ()) -> None:
    """Give a run, unless it has begun, the trials and the learner's state of another.

    A run and its bytes depend on its seed, its settings and, trial by trial, on its
    world; so where only the damage differs, and sets in after the trunk's last trial,
    the branch is what it would have been had it been run from the start.

    Args:
        trunk: of a finished run that `experiments` keeps.
        branch: of the run to begin, which goes on for longer.
        idle: sections in which the two may differ since, up to there, what they ask
            for does nothing; that is the caller's to see.

    Raises:
        BnsError: the two differ before the trunk's end.
    """
    from bns.experiment.record import Step
    from bns.experiment.run import facts
    from bns.storage.store import RunStore
    from bns.worlds.damage import Damage

    shared = replace(branch, **{name: getattr(trunk, name) for name in idle})
    refuse_unlike(trunk, shared, Damage.parse(branch.world.damage).first_trial)
    place = directory(branch)
    if (place / "run.json").exists():
        return
    kept = RunStore.open(directory(trunk))
    record, (done, state) = kept.record(), kept.read_state()
    known = facts(branch, kept.mode)
    begun = RunStore(place, branch, kept.mode, kept.versions, **known).create()
    arrays = {n: getattr(record, n) for n in ("sent", "poses", "predicted")}
    arrays |= record.extra
    for trial in range(done):
        columns = {name: column[:, trial] for name, column in record.columns.items()}
        if branch.watch.forget:  # a trunk that was not asked to forgot nothing
            columns.setdefault("forgotten", np.zeros(trunk.replicates))
        rows = {name: array[:, trial] for name, array in arrays.items()}
        begun.write_step(trial, Step(columns, rows))
    begun.write_state(done, state)
    begun.close()


def refuse_unlike(trunk: RunConfig, branch: RunConfig, onset: int) -> None:
    """Stop where a branch would not have been as its trunk.

    Raises:
        BnsError: settings differ beside damage and number of trials, or the damage
            sets in too early.
    """
    world = replace(branch.world, damage=trunk.world.damage)
    alike = replace(branch, preset=trunk.preset, trials=trunk.trials, world=world)
    if alike != trunk or trunk.world.damage or 0 <= onset < trunk.trials:
        raise BnsError(
            f"{branch.preset} is no continuation of {trunk.preset}: give the same "
            f"settings and seed, and damage from trial {trunk.trials} on."
        )
    if trunk.record_replicates:
        raise BnsError("A branch has no samples: set record_replicates = 0.")
