"""The record of a batch of BNS runs: what analysis, reports and pictures read."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bns.experiment.config import RunConfig


@dataclass(frozen=True, eq=False)
class RunRecord:
    """R replicates over T trials of one configuration.

    Shapes use R replicates, T trials done, K the longest command list.

    Attributes:
        config: the resolved configuration.
        versions: package versions, machine and commit that made it.
        columns: per-trial figures, each ``(R, T)``:
            fitness: of the controller tried, in the world (minimised).
            fitness_best: of the population's best, in the world.
            fitness_predicted: of the controller tried, inside the SNN before the trial.
            reached: objectives reached in the world.
            solved: 1 where all objectives were reached.
            diversity_41, diversity_51, diversity_73: thesis equations 4.1, 5.1, 7.3.
            snn_forward, snn_left, snn_turn: RMS error of the SNN on this trial's
                commands before training on them [m, m, rad].
            snn_loss: mean squared training error after training (scaled outputs).
            patterns: patterns the SNN was trained on.
            damaged: 1 where any damage was on.
            commands: commands in the list.
        sent: commands tried as sent, ``(R, T, K, 3)`` (left, right [m/s], duration
            [s]), NaN beyond the list.
        poses: observed pose at the start and after each command,
            ``(R, T, K + 1, 3)`` [m, m, rad], NaN beyond.
        predicted: the same as the SNN foresaw it, ``(R, T, K + 1, 3)``.
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
        return self.sent.shape[0]

    @property
    def trials(self) -> int:
        """Number of trials T done by every run."""
        return self.sent.shape[1]

    def __getitem__(self, column: str) -> np.ndarray:
        return self.columns[column]
