"""Servos on levers integrated together: runs times candidate laws, one array program.

Semi-implicit Euler at a fixed step; the back-EMF is taken implicitly and dry friction
is exact (the torque that stops the lever within the step, clipped to its budget), as in
MuJoCo's `implicitfast` with a stiff friction loss. A test compares the two.
"""

from dataclasses import dataclass

import numpy as np

from bns.errors import BnsError
from bns.worlds.physics.servo_law import GRAVITY, NO_CURRENT_LIMIT, Law

DT = 0.002  # [s] default step


@dataclass(frozen=True, eq=False)
class Drive:
    """What R servos are told, on the physics grid.

    Attributes:
        goals: goal angle in force at each step [rad], shape ``(R, S)``.
        start: angle at the start [rad], shape ``(R,)``.
        speed: speed at the start [rad/s], shape ``(R,)``.
        torque_on: whether the motor is powered, shape ``(R, S)``; None = always.
        dt: physics step [s].
        every: steps between two samples of the result.
    """

    goals: np.ndarray
    start: np.ndarray
    speed: np.ndarray
    torque_on: np.ndarray | None = None
    dt: float = DT
    every: int = 5

    def __post_init__(self) -> None:
        runs, steps = np.shape(self.goals)
        if np.shape(self.start) != (runs,) or np.shape(self.speed) != (runs,):
            raise BnsError(f"Drive needs a start and a speed for each of {runs} runs.")
        if self.torque_on is not None and np.shape(self.torque_on) != (runs, steps):
            raise BnsError("Drive.torque_on needs the shape of Drive.goals.")

    @property
    def samples(self) -> int:
        """Samples of the result, the start included."""
        return self.goals.shape[1] // self.every + 1


def simulate(law: Law, drive: Drive) -> np.ndarray:
    """What the encoders read.

    Args:
        law: each number of shape ``(R, C)``, or broadcasting to it: C candidate laws
            for each run.
        drive: R runs.

    Returns:
        Encoder readings every `drive.every` steps, shape ``(R, C, T)`` [rad].
    """
    runs = len(drive.start)
    shape = np.broadcast_shapes((runs, 1), *(np.shape(v) for v in law.values()))
    law = {name: np.asarray(value, np.float64) for name, value in law.items()}
    state = _State(law, drive, shape)
    read = np.empty((drive.samples, *shape))
    read[0] = state.angle + law["offset"]
    for step in range((drive.samples - 1) * drive.every):
        state.advance(step)
        if (step + 1) % drive.every == 0:
            read[(step + 1) // drive.every] = state.angle + law["offset"]
    return _quantised(np.moveaxis(read, 0, -1), law["quantisation"])


def _quantised(read: np.ndarray, step: np.ndarray) -> np.ndarray:
    if not np.any(step):
        return read
    step = np.broadcast_to(step, read.shape[:-1])[..., None]
    return np.where(step > 0, np.rint(read / np.maximum(step, 1e-12)) * step, read)


class _Goals:
    """Goals as they arrive: delayed, then lagged."""

    def __init__(self, law: Law, drive: Drive, shape: tuple[int, ...]):
        self.columns = np.ascontiguousarray(drive.goals.T)
        self.rows = np.arange(shape[0])[:, None]
        steps = law["delay"] / drive.dt
        self.late = np.any(steps)
        self.common = steps.ndim == 0 or steps.size == 1
        self.whole = np.floor(steps).astype(np.int64)
        self.part = steps - self.whole
        self.lagged = np.any(law["lag"])
        if self.lagged:
            safe = np.maximum(law["lag"], 1e-9)
            self.share = -np.expm1(-drive.dt / safe)
            self.value = np.broadcast_to(self.columns[0][:, None], shape).copy()

    def at(self, step: int) -> np.ndarray:
        """Goals in force in a step [rad], ``(R, 1)`` or ``(R, C)``."""
        goal = self._delayed(step) if self.late else self.columns[step][:, None]
        if not self.lagged:
            return goal
        self.value += self.share * (goal - self.value)
        return self.value

    def _delayed(self, step: int) -> np.ndarray:
        first = np.maximum(step - self.whole, 0)
        before = np.maximum(first - 1, 0)
        if self.common:
            new = self.columns[first.item()][:, None]
            old = self.columns[before.item()][:, None]
        else:
            new = self.columns[first, self.rows]
            old = self.columns[before, self.rows]
        return new + self.part * (old - new)


class _State:
    """Angles and speeds of all servos, and one step of theirs."""

    def __init__(self, law: Law, drive: Drive, shape: tuple[int, ...]):
        self.law, self.dt, self.goals = law, drive.dt, _Goals(law, drive, shape)
        self.on = None if drive.torque_on is None else drive.torque_on.T[..., None]
        self.angle = np.broadcast_to(drive.start[:, None], shape) - law["offset"]
        self.speed = np.broadcast_to(drive.speed[:, None], shape).copy()
        self.stiffness = law["gain"] * law["error_gain"]
        self.stall = law["torque_constant"] * law["voltage"] / law["resistance"]
        self.brake = law["torque_constant"] ** 2 / law["resistance"]
        arm, square = law["arm_mass"], law["lever"] ** 2
        own = law["mass"] * law["gyration"] ** 2
        self.carried = (law["mass"] + arm / 3) * square + own
        self.inertia = self.carried + law["armature"]
        self.weight = GRAVITY * law["lever"] * (law["mass"] + arm / 2)
        self.limited = np.any(law["current_limit"] < NO_CURRENT_LIMIT)
        self.has = {name: bool(np.any(value)) for name, value in law.items()}
        self.gap = np.zeros(shape)  # of the motor ahead of the lever, +- backlash / 2
        self.motor_speed = self.speed.copy()

    def advance(self, step: int) -> None:
        """Go on by one step."""
        load = -self.weight * np.sin(self.angle)
        motor, brake = self._motor(step)
        if self.has["backlash"]:
            self._with_play(motor, brake, load)
            return
        self.speed = self._moved(self.speed, motor, brake, load, self.inertia)
        self.motor_speed = self.speed
        self.angle = self.angle + self.dt * self.speed

    def _motor(self, step: int) -> tuple[np.ndarray, np.ndarray]:
        """Torque at speed zero, and what the speed takes of it [N m s/rad]."""
        law = self.law
        error = self.goals.at(step) - (self.angle + law["offset"])
        if self.has["dead_zone"]:
            zone = law["dead_zone"]
            error = error - np.clip(error, -zone, zone)
        duty = np.clip(self.stiffness * error, -law["duty_limit"], law["duty_limit"])
        motor, brake = self.stall * duty, self.brake
        if self.limited:
            most = law["torque_constant"] * law["current_limit"]
            free = motor - brake * self.motor_speed
            motor = np.where(np.abs(free) > most, np.sign(free) * most, motor)
            brake = np.where(np.abs(free) > most, 0.0, brake)
        if self.on is not None:  # an unpowered bridge is open: no back-EMF either
            motor, brake = motor * self.on[step], brake * self.on[step]
        return motor, brake

    def _moved(
        self,
        speed: np.ndarray,
        motor: np.ndarray,
        brake: np.ndarray,
        load: np.ndarray,
        inertia: np.ndarray,
    ) -> np.ndarray:
        """Speed after a step under motor, load and friction."""
        law, fast = self.law, np.abs(speed)
        budget = law["coulomb"] + law["viscous"] * fast
        if self.has["stribeck"]:
            budget = budget + law["stribeck"] * np.exp(-fast / law["stribeck_speed"])
        torque = motor - brake * speed
        if self.has["load_friction"]:
            budget = budget + law["load_friction"] * np.abs(torque - load)
        felt = inertia + self.dt * brake
        impulse = self.dt * (torque + load)
        free = speed * felt + impulse
        limit = self.dt * budget
        return (free - np.clip(free, -limit, limit)) / felt

    def _with_play(
        self, motor: np.ndarray, brake: np.ndarray, load: np.ndarray
    ) -> None:
        """One step with a gap between gears and lever; they meet without a bounce."""
        half, law, dt = self.law["backlash"] / 2, self.law, self.dt
        rotor = np.maximum(law["armature"], 1e-5)
        whole = self.carried + rotor
        joint = self._moved(self.speed, motor, brake, load, whole)
        push = self.carried * (joint - self.speed) - dt * load  # on the lever
        touching = (np.abs(self.gap) >= half) & (push * np.sign(self.gap) >= 0)
        touching |= half == 0
        lever = self.speed + dt * load / np.maximum(self.carried, 1e-9)
        rotor_speed = self._moved(self.motor_speed, motor, brake, 0.0 * load, rotor)
        gap = self.gap + dt * (rotor_speed - lever)
        met = np.abs(gap) >= half
        common = (rotor * rotor_speed + self.carried * lever) / whole
        self.speed = np.where(touching, joint, np.where(met, common, lever))
        self.motor_speed = np.where(touching, joint, np.where(met, common, rotor_speed))
        self.gap = np.where(touching, self.gap, np.clip(gap, -half, half))
        self.angle = self.angle + dt * self.speed
