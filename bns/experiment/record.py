"""The record of a batch of runs: what analysis, reports and pictures read.

It is made of steps, one for each trial of every run, as they are stored.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from bns.errors import FormatError, MissingDependencyError, install
from bns.experiment.config import RunConfig
from bns.storage import reading
from bns.worlds.trial import Channel, Commands, Outcome, Trial

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]


@dataclass(frozen=True, eq=False)
class RunRecord:
    """R replicates over T trials of one configuration.

    Shapes use R replicates, T trials done, K the longest command list.

    Attributes:
        config: the resolved configuration.
        versions: package versions, machine and commit that made it.
        columns: per-trial figures, each ``(R, T)``. Whatever the task and the learner:
            fitness: of the controller tried, in the world (minimised).
            fitness_best: of what the learner would drive with, in the world.
            solved_best: whether that did the task, where the learner deploys one.
            reached: objectives reached in the world.
            solved: 1 where the task was done.
            commands: commands in the list.
            damaged: 1 where any damage was on.
            evaluations: executions in the model world so far, where there is one.
            Others are declared by the task and the learner (`Task.columns`,
            `Learner.columns`).
        sent: commands tried as sent, ``(R, T, K, 3)`` (left, right [m/s], duration
            [s]), NaN beyond the list.
        poses: observed pose at the start and after each command,
            ``(R, T, K + 1, 3)`` [m, m, rad], NaN beyond.
        predicted: the same as the learner foresaw it, ``(R, T, K + 1, 3)``; NaN where
            it foresees nothing.
        damage_onset: first damaged trial per replicate, ``(R,)``; -1 = none.
        directory: where it was read from, empty if it was not.
        conditions: what was true of the world, by name.
        extra: what else a learner keeps of each trial, by name, each ``(R, T, ...)``.
    """

    config: RunConfig
    versions: Mapping[str, str]
    columns: Mapping[str, np.ndarray]
    sent: np.ndarray
    poses: np.ndarray
    predicted: np.ndarray
    damage_onset: np.ndarray
    directory: str = ""
    conditions: Mapping[str, object] = field(default_factory=dict)
    extra: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def replicates(self) -> int:
        """Number of runs R."""
        return len(self.sent)

    @property
    def trials(self) -> int:
        """Number of trials T done by every run."""
        return int(self.sent.shape[1])

    def __getitem__(self, column: str) -> np.ndarray:
        return self.columns[column]

    def to_pandas(self) -> "pandas.DataFrame":
        """The per-trial figures as a table, a row per replicate and trial.

        Raises:
            MissingDependencyError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise MissingDependencyError(
                "RunRecord.to_pandas", "pandas", install("pandas")
            ) from None
        runs, trials = np.indices((self.replicates, self.trials))
        keys = {"replicate": runs.ravel(), "trial": trials.ravel()}
        figures = {name: array.ravel() for name, array in self.columns.items()}
        return pandas.DataFrame(keys | figures)


ARRAYS = ("sent", "poses", "predicted")
_TRIAL = ("times", "observed", "boundaries", "handled")


@dataclass(frozen=True, eq=False)
class Step:
    """What R runs did in one trial.

    Attributes:
        columns: the per-trial figures of `RunRecord`, each ``(R,)``.
        arrays: "sent" ``(R, K, C)``, "poses" and "predicted" ``(R, K + 1, 3)``, and
            what else a learner gives, the run first.
        trials: the trials of the recorded replicates with all their samples.
    """

    columns: Mapping[str, np.ndarray]
    arrays: Mapping[str, np.ndarray]
    trials: Sequence[Trial] = ()

    @classmethod
    def of(
        cls, observed: Mapping[str, np.ndarray], trials: Sequence[Trial] = ()
    ) -> "Step":
        """The step in what a learner's `observe` gives."""
        arrays = {n: np.asarray(v) for n, v in observed.items() if np.ndim(v) > 1}
        columns = {
            name: np.asarray(value, dtype=np.float64)
            for name, value in observed.items()
            if name not in arrays
        }
        return cls(columns, arrays, trials)

    def part(self, runs: slice) -> "Step":
        """The step of some of the runs, without dense trials."""
        return Step(
            {name: value[runs] for name, value in self.columns.items()},
            {name: value[runs] for name, value in self.arrays.items()},
        )

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Everything as named arrays, none of them of objects.

        Returns:
            name -> array: "column.NAME" ``(R,)``, "array.NAME" with the run first,
            "trials" (JSON as uint8), and the samples of trial n as "trialn.NAME".
        """
        stored = {f"column.{name}": value for name, value in self.columns.items()}
        stored |= {f"array.{name}": value for name, value in self.arrays.items()}
        meta = [_trial_meta(trial) for trial in self.trials]
        stored["trials"] = np.frombuffer(json.dumps(meta).encode(), np.uint8)
        for index, trial in enumerate(self.trials):
            stored |= _trial_arrays(trial, f"trial{index}.")
        return stored

    @classmethod
    def from_arrays(
        cls, stored: Mapping[str, np.ndarray], name: str = "A stored step"
    ) -> "Step":
        """The step that `to_arrays` stored; `name` is the file's, for messages.

        Raises:
            FormatError: something is missing, or not as it was stored.
        """
        try:
            meta = reading.json(stored["trials"].tobytes(), name)
            trials = [
                _trial(item, stored, f"trial{index}.")
                for index, item in enumerate(meta)
            ]
        except reading.UNREADABLE as error:
            raise FormatError(f"{name} is not complete: {error}.") from error
        return cls(under("column.", stored), under("array.", stored), trials)


def assemble(
    config: RunConfig,
    steps: Sequence[Step],
    *,
    versions: Mapping[str, str],
    conditions: Mapping[str, object],
    damage_onset: np.ndarray,
    directory: str = "",
) -> RunRecord:
    """The record of the steps done so far (none: a record of zero trials).

    Args:
        config: of the run: R replicates, commands of K places.
        steps: one a trial, T of them, in order.
        versions: package -> version, of what ran.
        conditions: what else is known of how it ran.
        damage_onset: first damaged trial of each replicate, ``(R,)``.
        directory: of the run; empty where it is not stored.
    """
    runs, longest = config.replicates, config.controller.max_commands
    empty = {
        name: np.zeros((runs, 0, longest + (name != "sent"), 3)) for name in ARRAYS
    }
    names = list(steps[0].columns) if steps else []
    stacked = {
        name: np.stack([step.arrays[name] for step in steps], axis=1)
        for name in (steps[0].arrays if steps else ())
    }
    arrays = {name: stacked.pop(name, empty[name]) for name in ARRAYS}
    return RunRecord(
        config=config,
        versions=dict(versions),
        columns={n: np.stack([s.columns[n] for s in steps], axis=1) for n in names},
        damage_onset=np.asarray(damage_onset, dtype=np.int64),
        directory=directory,
        conditions=dict(conditions),
        extra=stacked,
        **arrays,
    )


def under(prefix: str, stored: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays whose names begin with a prefix, each as it was, without it."""
    return {
        name.removeprefix(prefix): value
        for name, value in stored.items()
        if name.startswith(prefix)
    }


def _plain(value: Any) -> Any:
    """NumPy values inside `conditions` as JSON values."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _plain_flag(value: Any) -> bool | int:
    """A flag or a counter of an outcome as JSON holds it."""
    return bool(value) if isinstance(value, bool | np.bool_) else int(value)


def _trial_meta(trial: Trial) -> dict[str, Any]:
    conditions = json.dumps(dict(trial.conditions), default=_plain)
    return {
        "channels": [list(channel) for channel in trial.channels],
        "command_channels": [list(channel) for channel in trial.commands.channels],
        "outcome": [_plain_flag(flag) for flag in trial.outcome],
        "robot": trial.robot,
        "world": trial.world,
        "conditions": json.loads(conditions),
        "truth": list(trial.truth),
    }


def _trial_arrays(trial: Trial, prefix: str) -> dict[str, np.ndarray]:
    stored = {prefix + name: getattr(trial, name) for name in _TRIAL}
    stored[f"{prefix}values"] = trial.commands.values
    stored[f"{prefix}durations"] = trial.commands.durations
    truth = {f"{prefix}truth.{name}": value for name, value in trial.truth.items()}
    return stored | truth


def _trial(
    meta: dict[str, Any], stored: Mapping[str, np.ndarray], prefix: str
) -> Trial:
    channels = tuple(Channel(*pair) for pair in meta["command_channels"])
    return Trial(
        Commands(stored[f"{prefix}values"], stored[f"{prefix}durations"], channels),
        **{name: stored[prefix + name] for name in _TRIAL},
        channels=tuple(Channel(*pair) for pair in meta["channels"]),
        outcome=Outcome(*meta["outcome"]),
        robot=meta["robot"],
        world=meta["world"],
        conditions=meta["conditions"],
        truth={name: stored[f"{prefix}truth.{name}"] for name in meta["truth"]},
    )
