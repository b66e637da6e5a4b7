"""Inputs and outputs of the walking SNN, scaled to about -1..1.

Inputs (thesis 7.2.5): the servos' present goals and their next ones, at the start all
half-way. Outputs: forward, left [m] and turn [rad] of the command in the body frame at
its start.
"""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from bns.worlds.trial import Trial, body_displacements

GOAL = 0.5  # [rad] that is scaled to 1; assumed
MOVED = (0.05, 0.05, 0.25)  # [m, m, rad] of a command that are scaled to 1; assumed


def inputs(goals: Tensor) -> Tensor:
    """Network inputs of command lists, goals ``(..., K, C)`` [rad].

    Returns:
        ``(..., K, 2 C)``, scaled.
    """
    before = torch.nn.functional.pad(goals, (0, 0, 1, 0))[..., :-1, :]
    return torch.cat([before, goals], dim=-1) / GOAL


class Scaling(NamedTuple):
    """Scale of the outputs, ``(3,)`` [m, m, rad]; as `bns.snn.scaling.Scaling`."""

    output: Tensor = torch.tensor(MOVED)


def of_trial(trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """What the commands of a trial were and did.

    Returns:
        scaled inputs ``(K, 2 C)`` and displacements ``(K, 3)`` [m, m, rad]; commands
        whose pose was lost at either end, and diverged trials, are left out.
    """
    seen = inputs(torch.from_numpy(trial.commands.values.copy())).numpy()
    moved = body_displacements(trial.command_poses_world)
    good = np.isfinite(moved).all(1) & trial.outcome.usable
    return seen[good], moved[good]
