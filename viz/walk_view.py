"""What a recording of walking shows otherwise: legs as the servos said they stood."""

import numpy as np

from bns.viz import geometry
from bns.worlds.trial import Trial

SUFFIX = "_position"
"""of the channels that servos report"""


def reports_servos(trial: Trial) -> bool:
    """Whether the trial holds positions of servos."""
    return any(channel.name.endswith(SUFFIX) for channel in trial.channels)


def qpos(model, poses_world: np.ndarray, trial: Trial, rows: np.ndarray) -> np.ndarray:
    """Configurations from tracked poses and servo positions.

    An overhead tracker sees neither height nor tilt: the body is drawn level, with its
    lowest foot on the floor.

    Args:
        model: a compiled `mujoco.MjModel`; its joints have the channels' names.
        poses_world: ``(T, 3)`` [m, m, rad].
        trial: with channels of servo positions.
        rows: samples of the trial that the poses are of, ``(T,)``.

    Returns:
        ``(T, nq)``.
    """
    made = geometry.planar_qpos(model, poses_world)
    for channel in trial.channels:
        if channel.name.endswith(SUFFIX):
            joint = model.joint(channel.name.removesuffix(SUFFIX))
            made[:, joint.qposadr[0]] = trial.channel(channel.name)[rows]
    made[:, geometry.free_joint(model) + 2] -= _lowest_foot(model, made)
    return made


def _lowest_foot(model, qpos: np.ndarray) -> np.ndarray:
    """Height of the lowest foot site in each configuration, ``(T,)`` [m]."""
    import mujoco

    data = mujoco.MjData(model)
    feet = [i for i in range(model.nsite) if model.site(i).name.endswith("_foot")]
    lowest = np.zeros(len(qpos))
    for at, configuration in enumerate(qpos):
        data.qpos[:] = configuration
        mujoco.mj_kinematics(model, data)
        lowest[at] = data.site_xpos[feet, 2].min() if feet else 0.0
    return lowest
