"""What is observed of a user's own model, from its physics states."""

from dataclasses import dataclass

import mujoco
import numpy as np

from bns.gap.models.mjcf import prepared
from bns.gap.models.mjcf.config import OwnConfig
from bns.worlds.physics.rollout import STATE


@dataclass(frozen=True, eq=False)
class View:
    """Where each observed channel is found.

    Attributes:
        config: the description.
        columns: per channel the column of the full physics state, -1 = kinematics.
        parts: per channel the number of the site or body, -1 = a joint.
    """

    config: OwnConfig
    columns: tuple[int, ...]
    parts: tuple[int, ...]

    @classmethod
    def of(cls, config: OwnConfig, model: mujoco.MjModel) -> "View":
        """Find the channels in a model.

        Raises:
            UnknownNameError: a joint, site or body that the model lacks.
        """
        columns, parts = [], []
        for item in config.seen:
            kind = "joint" if item.quantity == "speed" else item.quantity
            number = prepared.number(model, kind, item.part)
            at = -1
            if item.quantity == "joint":
                at = 1 + int(model.jnt_qposadr[number])
            elif item.quantity == "speed":
                at = 1 + model.nq + int(model.jnt_dofadr[number])
            columns.append(at)
            parts.append(-1 if at >= 0 else number)
        return cls(config, tuple(columns), tuple(parts))

    def read(self, model: mujoco.MjModel, states: np.ndarray) -> np.ndarray:
        """Readings ``(T, C)`` from full physics states ``(T, n)``."""
        made = np.empty((len(states), len(self.columns)))
        for channel, column in enumerate(self.columns):
            if column >= 0:
                made[:, channel] = states[:, column]
        placed = [c for c, column in enumerate(self.columns) if column < 0]
        if not placed:
            return made
        data = mujoco.MjData(model)
        for row, state in enumerate(states):
            if not np.isfinite(state).all():
                made[row, placed] = np.nan
                continue
            mujoco.mj_setState(model, data, state, STATE)
            mujoco.mj_kinematics(model, data)
            for channel in placed:
                item = self.config.seen[channel]
                where = data.site_xpos if item.quantity == "site" else data.xpos
                made[row, channel] = where[self.parts[channel], item.axis]
        return made

    def place(self, data: mujoco.MjData, seen: np.ndarray) -> None:
        """Set the observed joints to what was recorded, ``(C,)``."""
        nq = data.model.nq
        for channel, column in enumerate(self.columns):
            if 0 < column <= nq:
                data.qpos[column - 1] = seen[channel]
