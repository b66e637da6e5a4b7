"""The body of an emulated Khepera III: MuJoCo, stepped as time goes by."""

from collections import deque
from collections.abc import Sequence

import mujoco
import numpy as np

from bns import models
from bns.errors import BnsError
from bns.models.arena import SIZE
from bns.worlds import active, compile, observe
from bns.worlds.effects.base import ControlSignal, Effect
from bns.worlds.physics import STATE

HISTORY = 3.0  # s of set points that effects see again; longer memories fade out
KEPT = 6000  # poses remembered, 30 s
FALL_BEHIND = 0.5  # s; a host that slept longer lets the robot's time skip

# m -> value, a white wall before the two front sensors of a real robot
# (khepera3toolbox, infrared_proximity_sensor_response, black floor)
PROXIMITY = (
    (0, 0.0045, 0.009, 0.0135, 0.018, 0.0225, 0.027, 0.0315, 0.036, 0.0405, 0.045,
     0.0495, 0.0585, 0.0675, 0.0765, 0.0855, 0.0945, 0.1035, 0.153, 0.252, 0.4455),
    (3983, 3968, 3947, 3562, 2645, 1946, 1426, 1094, 841, 653, 532, 420, 285, 193,
     138, 101, 78, 60, 24, 11, 7),
)  # fmt: skip
DARK = 3800  # ambient value of an unlit room (assumed; smaller = more light)


class KheperaBody:
    """A Khepera III in MuJoCo that lives with the clock.

    Args:
        effects: what is wrong with it, as text or objects; hold from the start.
        start: pose (x, y, yaw) in the world frame [m, m, rad].
        at: time of the start [s].

    Raises:
        BnsError: an effect that a live robot cannot have.
    """

    def __init__(
        self,
        effects: Sequence[str | Effect] = (),
        *,
        start: Sequence[float] = (0.0, 0.0, 0.0),
        at: float = 0.0,
    ):
        self.robot = models.robot("khepera3")
        given = active.as_damage(tuple(effects))
        _refuse(given, self.robot.kind)
        held = [event.effect for event in given.events]
        body = tuple(e for e in held if e.stage == "body")
        self.signal = [e for e in held if e.stage in ("command", "actuator")]
        scene = compile.compiled("khepera3", body)
        self.model = scene.model
        self.data = mujoco.MjData(self.model)
        begin = compile.start_state(scene, tuple(float(v) for v in start))
        mujoco.mj_setState(self.model, self.data, begin, STATE)
        mujoco.mj_forward(self.model, self.data)
        self.dt = float(self.model.opt.timestep)
        self._free = compile.free_joint(self.model)
        self._from, self._steps = at, 0
        self._told: list[tuple[float, float, float]] = []  # not in force yet
        self._point = (0.0, 0.0)
        self._yaw = float(start[2])
        self.history: deque[tuple[float, float, float]] = deque(
            maxlen=max(round(HISTORY / self.dt), 1)
        )
        self.poses: deque[tuple[float, float, float, float]] = deque(maxlen=KEPT)
        self._remember()

    @property
    def now(self) -> float:
        """Time that the physics has reached [s]."""
        return self._from + self._steps * self.dt

    def tell(self, at: float, left: float, right: float) -> None:
        """A set point [m/s], in force from the time `at` on [s]."""
        self._told.append((at, left, right))

    def advance(self, now: float) -> None:
        """Step until `now` [s]; after a long sleep of the host, time skips."""
        behind = now - self.now
        if behind > FALL_BEHIND and self._steps and not self.moving:
            self._from += behind - FALL_BEHIND
        while self.now + self.dt <= now + 1e-9:
            self._step()

    @property
    def moving(self) -> bool:
        """Whether it is told to move, or still does."""
        return bool(
            any(self._point) or self._told or np.abs(self.wheel_speeds()).max() > 1e-3
        )

    def _step(self) -> None:
        while self._told and self._told[0][0] <= self.now + 1e-9:
            _, *point = self._told.pop(0)
            self._point = (point[0], point[1])
        self.history.append((self.now, *self._point))
        speeds = self._disturbed() if self.signal else np.array(self._point)
        self.data.ctrl[:] = speeds * self.robot.ctrl_per_command
        mujoco.mj_step(self.model, self.data)
        self._steps += 1
        self._remember()

    def _disturbed(self) -> np.ndarray:
        """The newest set point after the effects, which see `HISTORY` before it."""
        rows = np.array(self.history)
        given = ControlSignal(
            rows[:, 0] - self._from,
            rows[:, 1:],
            np.zeros(len(rows), np.int64),
            tuple(channel.name for channel in self.robot.channels),
            self.dt,
        )
        always = np.ones(len(rows), bool)
        rng = np.random.default_rng(0)
        for effect in self.signal:
            values = effect.apply(given, always, rng)
            given = ControlSignal(
                given.times, values, given.command, given.channels, given.dt
            )
        return given.values[-1]

    def _remember(self) -> None:
        pose = observe.planar(self.data.qpos[None, self._free], self._yaw)[0]
        self._yaw = pose[2]
        self.poses.append((self.now, *pose))

    def pose(self, at: float | None = None) -> np.ndarray:
        """True pose ``(3,)`` [m, m, rad] at a time not long ago; None = now."""
        if at is None or len(self.poses) < 2:
            return np.array(self.poses[-1][1:])
        back = round((self.now - at) / self.dt)
        index = min(max(len(self.poses) - 1 - back, 0), len(self.poses) - 1)
        return np.array(self.poses[index][1:])

    def wheel_angles(self) -> tuple[float, float]:
        """Left and right [rad]."""
        return self._joint("qpos", "jnt_qposadr")

    def wheel_speeds(self) -> tuple[float, float]:
        """Left and right, over the floor with the nominal wheel [m/s]."""
        left, right = self._joint("qvel", "jnt_dofadr")
        per = self.robot.ctrl_per_command
        return left / per, right / per

    def _joint(self, field: str, address: str) -> tuple[float, float]:
        at = [
            int(getattr(self.model, address)[self.model.joint(wheel.joint).id])
            for wheel in (self.robot.wheels["left"], self.robot.wheels["right"])
        ]
        values = getattr(self.data, field)
        return float(values[at[0]]), float(values[at[1]])

    def proximity(self) -> tuple[int, ...]:
        """11 infrared values: rays against the board's rim, which has no height here,
        and the floor below; an empty board gives the noise floor and the ground.
        """
        far = round(PROXIMITY[1][-1])
        ground = round(float(np.interp(0.0117, *PROXIMITY)))  # m above the floor
        return (*[far] * 9, ground, ground)

    def ambient(self) -> tuple[int, ...]:
        """11 ambient values of an unlit room."""
        return (DARK,) * 11

    def outside(self) -> bool:
        """Whether it has left the board."""
        x, y, _ = self.pose()
        return bool(abs(x) > SIZE[0] / 2 or abs(y) > SIZE[1] / 2)


def _refuse(given, kind: str) -> None:
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
