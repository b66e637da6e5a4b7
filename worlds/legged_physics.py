"""Rollouts of walking robots, command by command, each until the robot rests.

A command is rolled out as long as planned in one call; then it goes on in short pieces
until the robot rests or its time is up. So most commands cost one call, and the goals
are known beforehand all the same: the last one of a command is held.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from bns.worlds.physics import CONTROL, Compiled, _first_bad, _quiet

PIECE = 0.04  # [s] of a command that goes on
LOOK = 0.02  # [s] before the end of a piece in which the robot has to rest
STILL = (0.01, 0.1, 0.1)  # base [m/s], base [rad/s], joints [rad/s]; slower = rests


class Piece(NamedTuple):
    """A stretch of a command under one model.

    Attributes:
        compiled: the model.
        control: goals in force, shape ``(S, nu)`` [rad].
        limit: steps that the command may take from this stretch's start on; 0 = the
            command goes on in the next one.
    """

    compiled: Compiled
    control: np.ndarray
    limit: int


class WalkJob(NamedTuple):
    """What one robot does.

    Attributes:
        start: full physics state (time, qpos, qvel, ...), shape ``(n,)``.
        pieces: in order of time.
    """

    start: np.ndarray
    pieces: tuple[Piece, ...]


class Walk(NamedTuple):
    """What became of it.

    Attributes:
        states: full physics states, shape ``(S + 1, n)``, the start included; NaN from
            `diverged` on.
        control: goals in force in each step, shape ``(S, nu)``.
        touched: whether its own parts touched in each step, shape ``(S,)``.
        counts: steps of each command, shape ``(K,)``.
        rested: whether each command ended with the robot at rest, shape ``(K,)``.
        diverged: index of the first state that is not valid; -1 = all are.
    """

    states: np.ndarray
    control: np.ndarray
    touched: np.ndarray
    counts: np.ndarray
    rested: np.ndarray
    diverged: int


class _Course:
    """States, goals and contacts as they come."""

    def __init__(self, start: np.ndarray):
        self.states, self.control, self.touched = [start[None]], [], []
        self.steps, self.diverged = 0, -1
        self._roller, self._warm = Rollout(), None

    def go(self, compiled: Compiled, control: np.ndarray) -> None:
        """Roll out a stretch; nothing but NaN once the physics has diverged."""
        count, model = len(control), compiled.model
        states = np.full((count, self.states[0].shape[1]), np.nan)
        sensors = np.zeros((count, model.nsensordata))
        if self.diverged < 0:
            self._roll(compiled, control, states, sensors)
        self.states.append(states)
        self.control.append(control)
        self.touched.append(sensors.any(axis=1))
        self.steps += count

    def _roll(self, compiled, control, states, sensors) -> None:
        data = compiled.take()
        self._roller.rollout(
            [compiled.model],
            [data],
            self.states[-1][-1:],
            control[None],
            control_spec=CONTROL,
            skip_checks=True,
            nstep=len(control),
            initial_warmstart=self._warm,
            state=states[None],
            sensordata=sensors[None],
        )
        self._warm = data.qacc_warmstart[None].copy()
        warned = any(warning.number for warning in data.warning)
        compiled.give_back(data)
        bad = _first_bad(states, warned)
        if bad >= 0:
            states[bad:] = np.nan
            self.diverged = self.steps + 1 + bad

    def rests(self, model: mujoco.MjModel) -> bool:
        """Whether the robot has been still in the last moments."""
        look = max(round(LOOK / model.opt.timestep), 1)
        first = 1 + model.nq
        speed = np.abs(self.states[-1][-look:, first : first + model.nv]).max(axis=0)
        base, turn, joints = STILL
        return bool(
            speed[:3].max() < base
            and speed[3:6].max() < turn
            and speed[6:].max() < joints
        )


def walk(job: WalkJob) -> Walk:
    """Roll out one robot's commands."""
    _quiet()
    course, counts, rested, begun = _Course(job.start), [], [], 0
    for compiled, control, limit in job.pieces:
        course.go(compiled, control)
        if not limit:
            continue
        more = max(round(PIECE / compiled.model.opt.timestep), 1)
        end, still = course.steps - len(control) + limit, course.rests(compiled.model)
        while not still and course.steps < end and course.diverged < 0:
            held = min(more, end - course.steps)
            course.go(compiled, np.repeat(control[-1:], held, axis=0))
            still = course.rests(compiled.model)
        counts.append(course.steps - begun)
        rested.append(still)
        begun = course.steps
    return Walk(
        states=np.concatenate(course.states),
        control=np.concatenate(course.control),
        touched=np.concatenate(course.touched),
        counts=np.array(counts, np.int64),
        rested=np.array(rested, bool),
        diverged=course.diverged,
    )
