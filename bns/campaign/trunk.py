"""Trials that sides share up to their damage, trained once.

Until a damage sets in, and for as long as no adaptation has been told of it, sides that
differ in nothing else are the same to the byte if they have the same seed. Such a
*trunk* is trained once, by any of them, and kept as the learner's state and the figures
of its trials; each side goes on from there. Without the file a side trains those trials
itself, and is the same.
"""

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bns.experiment.config import RunConfig
from bns.learners.bns.config import AdaptationConfig
from bns.storage import files
from bns.worlds.damage import Damage
from bns.worlds.world import World

ON_DAMAGE = (
    "population_reset",
    "simulator_reset",
    "simulator_reset_untrained",
    "data_reset",
    "restart",
    "mutation_rate_after",
    "mutation_magnitude_after",
)
"""settings of an adaptation that do nothing until damage is known"""

Beat = Callable[[int], None]


@dataclass(frozen=True, eq=False)
class Trunk:
    """Trials of R runs.

    Attributes:
        seed: of the batch.
        mode: "compiled" or "eager".
        columns: figures, each ``(R, T)``.
        state: of the learner after them.
    """

    seed: int
    mode: str
    columns: Mapping[str, np.ndarray]
    state: Mapping[str, np.ndarray]

    @property
    def trials(self) -> int:
        """How many there are."""
        return next(iter(self.columns.values())).shape[1]


def shared(config: RunConfig) -> int:
    """Trials of a side that do not know its damage: 0 = none, or it has no damage."""
    watched = config.watch.detect or config.adaptation.extra
    first = Damage.parse(config.world.damage).first_trial
    return 0 if watched else min(max(first, 0), config.trials)


def bare(config: RunConfig) -> RunConfig:
    """What a side is until its damage; sides with the same share a trunk."""
    plain = AdaptationConfig()
    told = {name: getattr(plain, name) for name in ON_DAMAGE}
    return replace(
        config,
        preset="",
        trials=max(1, shared(config)),
        adaptation=replace(config.adaptation, **told),
        world=replace(config.world, damage=()),
    )


def train(
    config: RunConfig,
    world: World,
    *,
    until: int,
    begun: Trunk | None = None,
    beat: Beat = lambda trials: None,
) -> Trunk:
    """Trials of a side, from its first one or from where its trunk ends.

    Args:
        config: of the side, with its seed and replicates.
        world: where it runs.
        until: number of trials.
        begun: its trunk.
        beat: called with the number of trials done, after each.

    Raises:
        BnsError: a setting that is not allowed.
    """
    from bns.experiment.batch import Batch, resolve
    from bns.experiment.world_factory import make_models

    settled, mode = resolve(config, begun.mode if begun else "")
    batch = Batch([settled], [world], models=make_models(settled))
    first = 0
    if begun is not None:
        batch.learner.restore({key: value.copy() for key, value in begun.state.items()})
        first = begun.trials
    steps = []
    for trial in range(first, until):
        step, _ = batch.advance(trial)
        steps.append(step.columns)
        beat(trial + 1)
    columns = {n: np.stack([step[n] for step in steps], axis=1) for n in steps[0]}
    if begun is not None:
        columns = {
            name: np.concatenate([begun.columns[name], values], axis=1)
            for name, values in columns.items()
        }
    return Trunk(config.seed, mode, columns, batch.learner.state())


def write(path: Path, trunk: Trunk) -> None:
    """Keep a trunk.

    Raises:
        StorageError: no space, or no permission.
    """
    head = json.dumps({"seed": trunk.seed, "mode": trunk.mode}).encode()
    arrays = {"head": np.frombuffer(head, np.uint8)}
    arrays |= {f"column.{name}": value for name, value in trunk.columns.items()}
    arrays |= {f"state.{name}": value for name, value in trunk.state.items()}
    sink = io.BytesIO()
    np.savez(sink, **arrays)  # type: ignore[arg-type]  # its stub has a flag, too
    files.make_directory(path.parent)
    files.write_bytes(path, sink.getvalue())


def read(path: Path, *, seed: int, trials: int) -> Trunk | None:
    """The trunk in a file; None where there is none of this seed and length.

    A file that cannot be read is as good as none: the trials are trained again.

    Args:
        path: of the file; it need not be there.
        seed: of the batch that is to go on from it.
        trials: how many it has to hold.
    """
    if not path.is_file():
        return None
    parts: dict[str, dict[str, np.ndarray]] = {"column": {}, "state": {}}
    try:
        with np.load(path, allow_pickle=False) as held:
            head = json.loads(held["head"].tobytes())
            for key in held.files:
                kind, _, name = key.partition(".")
                if name:
                    parts[kind][name] = held[key]
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return None
    found = Trunk(head["seed"], head["mode"], parts["column"], parts["state"])
    return found if (found.seed, found.trials) == (seed, trials) else None
