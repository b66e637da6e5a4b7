"""What emulated robots share: a body in MuJoCo and a device that answers for it.

The body is stepped as time goes by. Devices answer over a pseudo terminal, or over a
line that rehearses them in virtual time.
"""

import copy
import heapq
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import mujoco
import numpy as np

from bns import models
from bns.errors import BnsError
from bns.hardware.clock import VirtualClock
from bns.hardware.faults import LinkError
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


class Reply(NamedTuple):
    """Bytes that a device sends.

    Attributes:
        at: when they are there [s].
        data: the bytes.
    """

    at: float
    data: bytes


class Device(Protocol):
    """An emulated robot's electronics, without a clock or port of its own."""

    def receive(self, data: bytes, now: float) -> list[Reply]:
        """Take bytes from the host; gives what is sent in answer, and when."""
        ...

    def advance(self, now: float) -> None:
        """Let the physics go on until `now` [s]."""
        ...


class Noise:
    """A bad line around a device: bytes get lost, packets get corrupted.

    Args:
        device: behind the line.
        lost: probability that a byte is lost, either way.
        corrupted: probability that one byte of a packet is another one, either way.
        rng: the only source of randomness.

    Attributes:
        counts: bytes lost and packets corrupted so far.
    """

    def __init__(
        self,
        device: Device,
        *,
        lost: float = 0.0,
        corrupted: float = 0.0,
        rng: np.random.Generator,
    ):
        self.device, self.lost, self.corrupted, self.rng = device, lost, corrupted, rng
        self.counts = {"lost": 0, "corrupted": 0}

    def receive(self, data: bytes, now: float) -> list[Reply]:
        """As the device does, over the bad line."""
        replies = self.device.receive(self._spoilt(data), now)
        return [Reply(reply.at, self._spoilt(reply.data)) for reply in replies]

    def advance(self, now: float) -> None:
        """As the device does."""
        self.device.advance(now)

    def _spoilt(self, data: bytes) -> bytes:
        if not data or not (self.lost or self.corrupted):
            return data
        values = np.frombuffer(data, np.uint8).copy()
        if self.rng.random() < self.corrupted:
            at = int(self.rng.integers(len(values)))
            values[at] ^= 1 << int(self.rng.integers(8))
            self.counts["corrupted"] += 1
        keep = self.rng.random(len(values)) >= self.lost
        self.counts["lost"] += int((~keep).sum())
        return values[keep].tobytes()


class VirtualLine:
    """A line to a device in the same process, in virtual time.

    Args:
        device: at its other end.
        clock: advanced while something waits for bytes.

    Attributes:
        plugged: False = the cable is out.
    """

    def __init__(self, device: Device, clock: VirtualClock):
        self.device, self.clock, self.plugged = device, clock, True
        self._due: list[tuple[float, int, bytes]] = []
        self._count = 0

    def write(self, data: bytes) -> None:
        """Send, see `Line.write`."""
        self._check()
        now = self.clock.now()
        self.device.advance(now)
        for reply in self.device.receive(data, now):
            self._count += 1
            heapq.heappush(self._due, (reply.at, self._count, reply.data))

    def order(self, data: bytes) -> None:
        """Send at once, see `Line.order`."""
        self.write(data)

    def read(self, timeout: float) -> bytes:
        """What has arrived, see `Line.read`."""
        self._check()
        now = self.clock.now()
        first = self._due[0][0] if self._due else float("inf")
        if first > now + timeout:
            self.clock.sleep(timeout)
            return b""
        self.clock.sleep(max(first - now, 0.0))
        return self._arrived()

    def discard(self) -> None:
        """Forget what has arrived."""
        self._check()
        self._arrived()

    def intruder(self) -> bool:
        """Nobody else can open it."""
        return False

    def others(self) -> list[str]:
        """Nobody else can open it."""
        return []

    def close(self) -> None:
        """Nothing to give back."""

    def _arrived(self) -> bytes:
        data = b""
        while self._due and self._due[0][0] <= self.clock.now() + 1e-12:
            data += heapq.heappop(self._due)[2]
        return data

    def _check(self) -> None:
        if not self.plugged:
            raise LinkError("The line is dead (unplugged): plug it in.")
