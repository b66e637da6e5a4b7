"""What is observed of a user's own model, from its physics states."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from bns.errors import UnknownNameError
from bns.gap.models.mjcf import floating, prepared
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.described import Seen
from bns.worlds.effects.parts import SEEN_PLAY


@dataclass(frozen=True, eq=False)
class View:
    """Where each observed channel is found.

    Attributes:
        config: the description.
        columns: per channel the column of the full physics state, -1 = kinematics; of
            how a free body is turned the first of its quaternion's.
        parts: per channel the number of the site, body or tendon, of a gyro of its
            site, -1 = it has a column.
        beyond: per channel the column of a play that its encoder is behind, -1 = none.
    """

    config: OwnConfig
    columns: tuple[int, ...]
    parts: tuple[int, ...]
    beyond: tuple[int, ...]

    @classmethod
    def of(cls, config: OwnConfig, model: mujoco.MjModel) -> "View":
        """Find the channels in a model.

        Raises:
            UnknownNameError: a joint, site, body, tendon or gyro that the model lacks.
        """
        columns, parts, beyond = [], [], []
        for item in config.seen:
            kind = "joint" if item.quantity == "speed" else item.quantity
            if kind == "gyro":
                number = gyro(model, item.part)
            else:
                number = prepared.number(model, kind, item.part)
            at = further = -1
            if kind == "joint":
                at = _jointed(model, item, number)
                name = model.joint(number).name + SEEN_PLAY
                play = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
                further = _jointed(model, item, play) if play >= 0 else -1
            elif item.quantity == "body":
                at = _floating(model, number, item)
            columns.append(at)
            parts.append(-1 if at >= 0 else number)
            beyond.append(further)
        return cls(config, tuple(columns), tuple(parts), tuple(beyond))

    def read(self, model: mujoco.MjModel, states: np.ndarray) -> np.ndarray:
        """Readings ``(T, C)`` from full physics states ``(T, n)``, one after the other:
        angles go on beyond half a turn. NaN where a state is not valid."""
        made = np.full((len(states), len(self.columns)), np.nan)
        good = np.isfinite(states).all(axis=1)
        placed = [c for c, column in enumerate(self.columns) if column < 0]
        for channel, item in enumerate(self.config.seen):
            column = self.columns[channel]
            if column >= 0 and item.turning and good.any():
                turned = Rotation.from_quat(
                    states[good, column : column + 4], scalar_first=True
                )
                frames = turned.as_matrix().reshape(-1, 9)
                made[good, channel] = angle(frames, item.way)
            elif column >= 0:
                made[:, channel] = states[:, column]
                if self.beyond[channel] >= 0:
                    made[:, channel] += states[:, self.beyond[channel]]
        if placed and good.any():
            made[np.ix_(good, placed)] = self._placed(model, states[good], placed)
        return made

    def _placed(
        self, model: mujoco.MjModel, states: np.ndarray, channels: Sequence[int]
    ) -> np.ndarray:
        """Readings ``(T, K)`` of channels that kinematics tell, of valid states."""
        data, seen = mujoco.MjData(model), [self.config.seen[c] for c in channels]
        spun = {self.parts[c]: np.zeros(6) for c in channels if self._spins(c)}
        found = [
            spun[self.parts[channel]][item.axis : item.axis + 1]
            if self._spins(channel)
            else _found(data, item, self.parts[channel])
            for channel, item in zip(channels, seen, strict=True)
        ]
        ends = np.cumsum([len(each) for each in found])
        rows = np.empty((len(states), ends[-1]))
        tendons = any(item.quantity == "tendon" for item in seen)
        for number, state in enumerate(states):
            data.qpos[:] = state[1 : 1 + model.nq]
            mujoco.mj_kinematics(model, data)
            if tendons:
                mujoco.mj_comPos(model, data)
                mujoco.mj_tendon(model, data)
            if spun:
                data.qvel[:] = state[1 + model.nq : 1 + model.nq + model.nv]
                mujoco.mj_comPos(model, data)
                mujoco.mj_comVel(model, data)
            for site, speeds in spun.items():
                mujoco.mj_objectVelocity(model, data, _SITE, site, speeds, 1)
            rows[number] = np.concatenate(found)
        parts = np.split(rows, ends[:-1], axis=1)
        made = [
            angle(part, item.way) if item.turning else part[:, 0]
            for item, part in zip(seen, parts, strict=True)
        ]
        return np.stack(made, axis=1)

    def _spins(self, channel: int) -> bool:
        return self.config.seen[channel].quantity == "gyro"

    def place(self, data: mujoco.MjData, seen: np.ndarray) -> None:
        """Set the observed joints to what was recorded, ``(C,)``, and of a free body
        that does not settle what was observed."""
        bodies: dict[str, dict[str, float]] = {}
        for channel, item in enumerate(self.config.seen):
            column = self.columns[channel] - 1
            if item.quantity == "joint":
                data.qpos[column] = seen[channel]
            elif item.quantity == "body" and column >= 0 and not self.config.settle:
                bodies.setdefault(item.part, {})[item.way] = seen[channel]
        for body, places in bodies.items():
            floating.place(data, data.model.body(body).id, places)


_SITE = mujoco.mjtObj.mjOBJ_SITE


def gyro(model: mujoco.MjModel, name: str) -> int:
    """Number of the site of a gyro.

    Raises:
        UnknownNameError: no gyro of the model is called so.
    """
    known = gyros(model)
    if name not in known:
        raise UnknownNameError("gyro", name, known)
    return int(model.sensor(name).objid[0])


def gyros(model: mujoco.MjModel) -> list[str]:
    """Names of the gyros of a model."""
    found = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_GYRO)
    names = (model.sensor(int(number)).name for number in found)
    return [name for name in names if name]


def _jointed(model: mujoco.MjModel, item: Seen, joint: int) -> int:
    """Column of the full physics state that holds where a joint is, or how fast."""
    if item.quantity == "speed":
        return 1 + model.nq + int(model.jnt_dofadr[joint])
    return 1 + int(model.jnt_qposadr[joint])


def _found(data: mujoco.MjData, item: Seen, part: int) -> np.ndarray:
    """Where the numbers of a channel come to stand: one, or the axes of what is turned,
    ``(9,)``."""
    if item.quantity == "tendon":
        return data.ten_length[part : part + 1]
    frames = {"site": data.site_xmat, "body": data.xmat}
    places = {"site": data.site_xpos, "body": data.xpos}
    if item.turning:
        return frames[item.quantity][part]
    return places[item.quantity][part, item.axis : item.axis + 1]


def angle(frames: np.ndarray, turn: str) -> np.ndarray:
    """Roll, pitch or yaw [rad], ``(T,)``, going on beyond half a turn.

    Args:
        frames: axes of what is turned, a row-major matrix each, ``(T, 9)``.
        turn: one of `described.TURNS`.
    """
    if turn == "pitch":
        made: np.ndarray = np.arcsin(np.clip(-frames[:, 6], -1.0, 1.0))
        return made
    over, under = (7, 8) if turn == "roll" else (3, 0)
    return np.unwrap(np.arctan2(frames[:, over], frames[:, under]))


def _floating(model: mujoco.MjModel, body: int, item: Seen) -> int:
    """Column of the full physics state that holds where a body on a free joint is, or
    the first of those of how it is turned; -1 = it has none."""
    joint = prepared.free_joint(model, body)
    first = 1 + int(model.jnt_qposadr[joint])
    return -1 if joint < 0 else first + (3 if item.turning else item.axis)
