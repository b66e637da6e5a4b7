"""Duty factors of a walk as it went: the share of time each foot is on the ground.

The behaviour of Cully et al. (2015). It needs what only a simulation tells, where the
body is in space; the legs are where the servos reported.
"""

from collections.abc import Sequence

import numpy as np

from bns.errors import BnsError
from bns.models.phantomx import kinematics
from bns.worlds.trial import Trial

GROUND = 0.005
"""[m] a foot below it touches the ground; its centre rests at 1.3 to 1.8 mm"""


def duty(trials: Sequence[Trial]) -> np.ndarray:
    """Share of the samples in which each foot touches the ground.

    Args:
        trials: N of a world with `truth`, of the robot phantomx.

    Returns:
        ``(N, 6)``, NaN where the physics diverged.

    Raises:
        BnsError: trials without the hidden states, or of another robot.
    """
    return np.array([_duty(trial) for trial in trials])


def _duty(trial: Trial) -> np.ndarray:
    if "qpos" not in trial.truth or trial.observed.shape[1] < 21:
        raise BnsError(
            "Contacts are known of the robot 'phantomx' in a world with truth alone: "
            "give --behaviour told."
        )
    if not trial.outcome.usable:
        return np.full(6, np.nan)
    free = trial.truth["qpos"][:, :7]
    feet = kinematics.feet(trial.observed[:, 3:21])
    x, y = free[:, 4], free[:, 5]
    w, z = free[:, 3], free[:, 6]
    up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    heights = free[:, 2, None] + np.einsum("ks,slk->sl", up, feet)
    found: np.ndarray = (heights < GROUND).mean(0)
    return found
