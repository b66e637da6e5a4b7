"""Rollouts of walking robots, command by command, each until the robot rests.

A command is rolled out as long as planned in one call; then it goes on in short pieces
until the robot rests or its time is up. So most commands cost one call, and the goals
are known beforehand all the same: the last one of a command is held.
"""

from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from bns.worlds.physics.rollout import CONTROL, Compiled, _first_bad, _quiet

PIECE = 0.06  # [s] of a command that goes on
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
        calls: of the physics that it took.
    """

    states: np.ndarray
    control: np.ndarray
    touched: np.ndarray
    counts: np.ndarray
    rested: np.ndarray
    diverged: int
    calls: int


class _Course:
    """States, goals and contacts as they come, in memory for the longest course."""

    def __init__(self, job: WalkJob):
        first = job.pieces[0].compiled.model
        longest = sum(max(len(piece.control), piece.limit) for piece in job.pieces)
        self.states = np.empty((longest + 1, len(job.start)))
        self.states[0] = job.start
        self.control = np.empty((longest, first.nu))
        self.touched = np.zeros((longest, first.nsensordata))
        self.steps, self.diverged, self.calls = 0, -1, 0
        self._roller = Rollout()
        self._warm: np.ndarray | None = None

    def go(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        control: np.ndarray,
        count: int,
    ) -> None:
        """Roll out a stretch; nothing but NaN once the physics has diverged."""
        at, end = self.steps, self.steps + count
        self.control[at:end] = control
        self.steps = end
        states = self.states[None, at + 1 : end + 1]
        if self.diverged >= 0:
            states[:] = np.nan
            return
        self._roller.rollout(
            [model],
            [data],
            self.states[at : at + 1],
            self.control[None, at:end],
            control_spec=CONTROL,
            skip_checks=True,
            nstep=count,
            initial_warmstart=self._warm,
            state=states,
            sensordata=self.touched[None, at:end],
        )
        self._warm = data.qacc_warmstart[None].copy()
        self.calls += 1
        bad = _first_bad(states[0], bool(data.warning.number.any()))
        if bad >= 0:
            states[0, bad:] = np.nan
            self.diverged = at + 1 + bad

    def rests(self, speeds: slice, still: np.ndarray, look: int) -> bool:
        """Whether the robot has been still in the last steps."""
        seen = self.states[self.steps + 1 - look : self.steps + 1, speeds]
        return bool((np.abs(seen) < still).all())


@cache
def _stillness(nv: int) -> np.ndarray:
    """Speeds below which a robot with a free base rests, shape ``(nv,)``."""
    base, turn, joints = STILL
    return np.array([base] * 3 + [turn] * 3 + [joints] * (nv - 6))


def walk(job: WalkJob) -> Walk:
    """Roll out one robot's commands."""
    _quiet()
    course, counts, rested, begun = _Course(job), [], [], 0
    for compiled, control, limit in job.pieces:
        data, model = compiled.take(), compiled.model
        course.go(model, data, control, len(control))
        if limit:
            end = course.steps - len(control) + limit
            rested.append(_waited(course, model, data, end))
            counts.append(course.steps - begun)
            begun = course.steps
        compiled.give_back(data)
    steps = course.steps
    return Walk(
        states=course.states[: steps + 1],
        control=course.control[:steps],
        touched=np.asarray(course.touched[:steps].any(axis=1)),
        counts=np.array(counts, np.int64),
        rested=np.array(rested, bool),
        diverged=course.diverged,
        calls=course.calls,
    )


def _waited(
    course: _Course, model: mujoco.MjModel, data: mujoco.MjData, end: int
) -> bool:
    """Go on with the last goals until the robot rests, or a step; whether it rests."""
    dt, first = model.opt.timestep, 1 + model.nq
    look, more = max(round(LOOK / dt), 1), max(round(PIECE / dt), 1)
    speeds, still = slice(first, first + model.nv), _stillness(model.nv)
    while not (done := course.rests(speeds, still, look)) and course.steps < end:
        if course.diverged >= 0:
            return False
        held = course.control[course.steps - 1]
        course.go(model, data, held, min(more, end - course.steps))
    return done
