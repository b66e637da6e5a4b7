"""A robot's body in MuJoCo, stepped as time goes by."""

import copy
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence

import mujoco
import numpy as np

from bns import models
from bns.errors import BnsError
from bns.worlds import active
from bns.worlds.damage import Damage
from bns.worlds.effects.base import (
    BodyEffect,
    CommandEffect,
    ControlSignal,
    Effect,
    ServoEffect,
)
from bns.worlds.physics import compile, observe
from bns.worlds.physics.rollout import STATE, Compiled

KEPT = 30.0  # s of poses remembered
FALL_BEHIND = 0.5  # s; a host that slept longer lets the time of a robot at rest skip


class LiveBody(ABC):
    """A robot that lives with the clock; `_begin` and `_drive` are the kinds' own.

    Args:
        robot: name of the model.
        effects: what is wrong with it, as text or objects; hold from the start.
        start: pose (x, y, yaw) in the world frame [m, m, rad].
        at: time of the start [s].

    Raises:
        BnsError: an effect that a live robot cannot have.
    """

    def __init__(
        self,
        robot: str,
        effects: Sequence[str | Effect],
        *,
        start: Sequence[float],
        at: float,
    ):
        self.robot = models.robot(robot)
        given = active.as_damage(tuple(effects))
        _refuse(given, self.robot.kind)
        held = [event.effect for event in given.events]
        body = tuple(e for e in held if _edits(e))
        self.signal = [e for e in held if isinstance(e, CommandEffect)]
        scene = compile.compiled(robot, body)
        self.model = copy.copy(scene.model)  # its own: a servo can be switched off
        self.data = mujoco.MjData(self.model)
        place = (float(start[0]), float(start[1]), float(start[2]))
        self.state = self._begin(scene, place)
        self.dt = float(self.model.opt.timestep)
        self._free = compile.free_joint(self.model)
        self._from, self._steps = at, 0
        self._yaw = float(start[2])
        kept = max(round(KEPT / self.dt), 2)
        self.poses: deque[np.ndarray] = deque(maxlen=kept)
        self._remember()

    def _begin(self, scene: Compiled, start: tuple[float, float, float]) -> np.ndarray:
        """Full physics state at the start."""
        return compile.start_state(scene, start)

    @abstractmethod
    def _drive(self) -> None:
        """Write what is in force now into `data.ctrl`."""

    @property
    @abstractmethod
    def moving(self) -> bool:
        """Whether it is told to move, or still does."""

    @property
    def now(self) -> float:
        """Time that the physics has reached [s]."""
        return self._from + self._steps * self.dt

    @property
    def state(self) -> np.ndarray:
        """Full state of the physics, ``(S,)`` (`mjSTATE_FULLPHYSICS`); may be set."""
        state = np.empty(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self.data, state, STATE)
        return state

    @state.setter
    def state(self, state: np.ndarray) -> None:
        """Put the body into a state, ``(S,)``."""
        mujoco.mj_setState(self.model, self.data, state, STATE)
        mujoco.mj_forward(self.model, self.data)

    def advance(self, now: float) -> None:
        """Step until `now` [s]; after a long sleep of the host, time skips."""
        behind = now - self.now
        if behind > FALL_BEHIND and self._steps and not self.moving:
            self._from += behind - FALL_BEHIND
        while self.now + self.dt <= now + 1e-9:
            self._drive()
            mujoco.mj_step(self.model, self.data)
            self._steps += 1
            self._remember()

    def _disturbed(self, times: np.ndarray, values: np.ndarray) -> np.ndarray:
        """What effects make of the newest of some set points, ``(C,)``.

        Args:
            times: of the set points [s], ``(S,)``.
            values: ``(S, C)``.
        """
        names = tuple(channel.name for channel in self.robot.channels)
        given = ControlSignal(
            times - self._from, values, np.zeros(len(times), np.int64), names, self.dt
        )
        always, rng = np.ones(len(times), bool), np.random.default_rng(0)
        for effect in self.signal:
            changed = effect.apply(given, always, rng)
            given = ControlSignal(
                given.times, changed, given.command, given.channels, given.dt
            )
        return given.values[-1]

    def _remember(self) -> None:
        free = self.data.qpos[self._free]
        pose = observe.planar(free[None], self._yaw)[0]
        self._yaw = pose[2]
        self.poses.append(np.concatenate([pose, free[2:]]))

    def pose(self, at: float | None = None) -> np.ndarray:
        """True pose ``(3,)`` [m, m, rad] at a time not long ago; None = now."""
        return self._kept(at)[:3].copy()

    def attitude(self, at: float | None = None) -> np.ndarray:
        """Height of the base and its quaternion, ``(5,)`` [m, 1]."""
        return self._kept(at)[3:].copy()

    def _kept(self, at: float | None) -> np.ndarray:
        """Between two physics steps; a step ahead of the newest by going straight on.

        A picture that showed the nearest step would be off by as much as 2.5 ms.
        """
        newest = len(self.poses) - 1
        if at is None or not newest:
            return self.poses[-1]
        place = newest - (self.now - at) / self.dt
        place = min(max(place, 0.0), newest + 1.0)
        before = min(int(place), newest - 1)
        one, other = self.poses[before], self.poses[before + 1]
        return one + (place - before) * (other - one)


def _edits(effect: Effect) -> bool:
    """Whether it is an edit of the model; those on servos are, at whatever stage."""
    return isinstance(effect, BodyEffect | ServoEffect)


def _refuse(given: Damage, kind: str) -> None:
    active.refuse(
        given, stages=("command", "actuator", "body"), kind=kind, world="emulator"
    )
    for event in given.events:
        if event.effect.random:
            raise BnsError(
                f"{event.effect.name} draws at random over a whole trial; an emulated "
                "robot cannot have it, give it as --world.damage instead."
            )
        if str(event) != str(event.effect):
            raise BnsError(
                f"{event}: an emulated robot has its effects from the start; leave the "
                "schedule away."
            )
