"""Scoring what robots did in a world, as opposed to what an SNN foresaw."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from bns.tasks.navigation import NavigationTask
from bns.worlds.trial import Trial


def score_trials(
    task: NavigationTask, trials: Sequence[Trial], longest: int
) -> tuple[Tensor, Tensor]:
    """Cost of N trials and how many objectives each reached, ``(N,)`` both.

    Args:
        task: on the CPU.
        trials: what was observed; a lost position counts as the last one seen.
        longest: commands of the longest list that is possible, K.
    """
    places = np.zeros((2, longest, len(trials)))
    for index, trial in enumerate(trials):
        seen = _filled(trial.command_poses_world[:, :2])
        count = len(trial.commands)
        places[:, :count, index] = seen[1:].T
        places[:, count:, index] = seen[-1:].T
    lengths = torch.tensor([len(trial.commands) for trial in trials])
    return task.score(*torch.from_numpy(places), lengths)


def _filled(places: np.ndarray) -> np.ndarray:
    """Positions with lost ones replaced by the last seen (the first is the start)."""
    seen = np.isfinite(places).all(1)
    last = np.maximum.accumulate(np.where(seen, np.arange(len(places)), 0))
    return np.nan_to_num(places[last])
