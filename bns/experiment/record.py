"""The record of a batch of runs: what analysis, reports and pictures read."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bns.errors import MissingDependencyError, install
from bns.experiment.config import RunConfig

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
