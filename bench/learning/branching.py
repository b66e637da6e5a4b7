"""A run that begins as a copy of another one, up to where the two begin to differ."""

from dataclasses import replace

import numpy as np

from bench.learning import experiments
from bns.errors import BnsError
from bns.experiment.config import RunConfig


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
    from bns.experiment.run import facts
    from bns.experiment.step import Step
    from bns.storage.store import RunStore
    from bns.worlds.damage import Damage

    shared = replace(branch, **{name: getattr(trunk, name) for name in idle})
    refuse_unlike(trunk, shared, Damage.parse(branch.world.damage).first_trial)
    place = experiments.directory(branch)
    if (place / "run.json").exists():
        return
    kept = RunStore.open(experiments.directory(trunk))
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
