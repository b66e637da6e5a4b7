"""A wheeled robot's planar dynamics, learnt from its own simulation.

A full simulation of each candidate at each magnitude is dear. Forward and turning
speed of a robot with speed-controlled wheels obey, from one physics step to the next,
a map that is almost linear; its few coefficients follow from 30 s of simulated random
driving by least squares. The map is then applied to thousands of command lists at
once. It is checked on further driving that it has not seen and used only where its
error there is far below what a tracker can see; other models are simulated in full.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.signal import lfilter

from bns.worlds import compile, observe
from bns.worlds.effects.base import BodyEffect
from bns.worlds.physics import Job, Segment, run

TRACK = (
    0.045  # [m] half the track, scales a turning speed to a wheel's; any near will do
)
KNEE = 0.002  # [m/s] within which dry friction changes its sign; assumed
TRAINING, CHECKING = 3, 1  # simulated drives
DRIVE = 10.0  # [s] each
SPEED = 0.16  # [m/s] largest speed in them
PASSES, SETTLED = 12, 1e-7  # until a change of speed below it [m/s, rad/s]
STEP = 0.1  # [s] over which the error is taken
GOOD = np.array([5e-5, 5e-5, 5e-4])  # [m, m, rad] error over STEP that passes


@dataclass(frozen=True, eq=False)
class Reduced:
    """One-step map of (forward speed [m/s], turning speed [rad/s]).

    Attributes:
        step: coefficients of the change per physics step, ``(9, 2)``.
        side: coefficients of the sideways speed, ``(3,)``.
        dt: physics step [s].
        good: whether it may stand in for the simulation.
    """

    step: np.ndarray
    side: np.ndarray
    dt: float
    good: bool

    def poses(self, told: np.ndarray) -> np.ndarray:
        """Planar poses from rest at the origin.

        Args:
            told: wheel speeds told, ``(N, S, 2)`` [m/s].

        Returns:
            ``(N, S + 1, 3)``.
        """
        speed = self._speeds(told).transpose(1, 0, 2)
        forward, turn = speed[..., 0].T, speed[..., 1].T
        left = (_side_terms(speed.reshape(-1, 2)) @ self.side).reshape(speed.shape[:2])
        yaw = np.cumsum(turn, axis=1) * self.dt
        return np.stack(_travel(forward, left.T, yaw, self.dt), axis=-1)

    def _speeds(self, told: np.ndarray) -> np.ndarray:
        """Forward and turning speed, ``(N, S + 1, 2)``.

        The linear part is a filter over time; the rest is put in from the last pass
        until it no longer changes, which takes a few passes.
        """
        count, steps, _ = told.shape
        linear = np.stack([self.step[0], TRACK * self.step[1]]) + np.eye(2)
        poles, modes = np.linalg.eig(linear)
        inputs = told @ self.step[2:4] + self.step[8]
        speed = np.zeros((count, steps + 1, 2))
        for _ in range(PASSES):
            bent = _terms(speed[:, :-1].reshape(-1, 2))
            drive = inputs + (bent @ self.step[4:8]).reshape(count, steps, 2)
            drive = drive @ modes
            for mode in (0, 1):
                drive[..., mode] = lfilter([1.0], [1.0, -poles[mode]], drive[..., mode])
            after = np.real(drive @ np.linalg.inv(modes))
            change = np.abs(after - speed[:, 1:]).max(initial=0.0)
            speed[:, 1:] = np.clip(after, -20.0, 20.0)
            if change < SETTLED:
                return speed
        return self._stepwise(told)

    def _stepwise(self, told: np.ndarray) -> np.ndarray:
        count, steps, _ = told.shape
        speed = np.zeros((steps + 1, count, 2))
        for t in range(steps):
            now = speed[t]
            change = _linear_terms(now, told[:, t]) @ self.step
            speed[t + 1] = np.clip(now + change, -20.0, 20.0)
        return speed.transpose(1, 0, 2)


def _travel(forward, left, yaw, dt):
    cos, sin = np.cos(yaw), np.sin(yaw)
    x = np.cumsum(cos * forward - sin * left, axis=1) * dt
    y = np.cumsum(sin * forward + cos * left, axis=1) * dt
    return x, y, yaw


def _linear_terms(speed: np.ndarray, told: np.ndarray) -> np.ndarray:
    v, w = speed.T
    return np.column_stack([v, TRACK * w, told, _terms(speed), np.ones_like(v)])


def _terms(speed: np.ndarray) -> np.ndarray:
    v, w = speed.T
    wheels = np.tanh((v[:, None] + TRACK * w[:, None] * np.array([-1, 1])) / KNEE)
    return np.column_stack([0.01 * w * w, 0.1 * v * w, wheels])


def _side_terms(speed: np.ndarray) -> np.ndarray:
    v, w = speed.T
    return np.column_stack([w, v * w, v])


@lru_cache(maxsize=4096)
def reduced(robot: str, effects: tuple[BodyEffect, ...], per_command: float) -> Reduced:
    """The map of a robot with body effects; made once per process.

    Args:
        robot: name of the robot model.
        effects: body effects.
        per_command: actuator control per m/s.
    """
    scene = compile.compiled(robot, effects)
    dt = scene.model.opt.timestep
    rng = np.random.default_rng(0)
    drives = [_drive(scene, rng, per_command) for _ in range(TRAINING + CHECKING)]
    kept = drives[:TRAINING]
    if not all(np.isfinite(speed).all() for speed, _, _ in drives):
        return Reduced(np.zeros((9, 2)), np.zeros(3), dt, good=False)
    terms = np.concatenate([_linear_terms(s[:-1, [0, 2]], u) for s, u, _ in kept])
    change = np.concatenate([np.diff(s[:, [0, 2]], axis=0) for s, _, _ in kept])
    seen = np.concatenate([s for s, _, _ in kept])
    side = np.linalg.lstsq(_side_terms(seen[:, [0, 2]]), seen[:, 1], rcond=None)[0]
    made = Reduced(_solve(terms, change), side, dt, good=True)
    good = all(_passes(made, u, pose) for _, u, pose in drives[TRAINING:])
    return Reduced(made.step, made.side, dt, good=good)


def _solve(terms: np.ndarray, change: np.ndarray) -> np.ndarray:
    scale = np.abs(terms).max(axis=0) + 1e-12
    ridge = 1e-6 * np.eye(terms.shape[1])
    left = np.vstack([terms / scale, ridge])
    right = np.vstack([change, np.zeros((len(ridge), change.shape[1]))])
    return np.linalg.lstsq(left, right, rcond=None)[0] / scale[:, None]


def _drive(
    scene: compile.Compiled, rng: np.random.Generator, per_command: float
) -> Sequence[np.ndarray]:
    """A simulated drive: body-frame speeds, speeds told, poses."""
    dt = scene.model.opt.timestep
    steps = round(DRIVE / dt)
    lengths = rng.integers(round(0.3 / dt), round(1.6 / dt), 60)
    index = np.repeat(np.arange(60), lengths)[:steps]
    told = rng.uniform(-SPEED, SPEED, (60, 2))[index]
    begin = compile.start_state(scene, (0.0, 0.0, 0.0))
    states = run(Job(begin, (Segment(scene, told * per_command),))).states
    place = compile.free_joint(scene.model)
    at = 1 + scene.model.nq
    pose = observe.planar(states[:, 1 + place.start : 1 + place.stop], 0.0)
    vx, vy, turn = states[:, at], states[:, at + 1], states[:, at + 5]
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    speed = np.column_stack([cos * vx + sin * vy, cos * vy - sin * vx, turn])
    return speed, told, pose


def _passes(made: Reduced, told: np.ndarray, pose: np.ndarray) -> bool:
    from bns.worlds.trial import body_displacements

    every = round(STEP / made.dt)
    found = body_displacements(made.poses(told[None])[0][::every])
    error = found - body_displacements(pose[::every])
    return bool((np.sqrt((error**2).mean(axis=0)) < GOOD).all())
