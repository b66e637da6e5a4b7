"""Rollouts of many robots at once, each with its own models and its own length.

Every robot is one job on a pool of threads; a job is one call of `mujoco.rollout` per
segment, without the interpreter lock, straight into a preallocated array. Against one
call for all robots this takes the same time, needs no padding to the longest robot,
and gives access to the solver's warm start, without which a continued rollout differs
in its last bits.

A walking robot's command is rolled out as long as planned in one call; then it goes on
in short pieces until the robot rests or its time is up. So most commands cost one call,
and the goals are known beforehand all the same: the last one of a command is held.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco.rollout import Rollout

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS.value
CONTROL = mujoco.mjtState.mjSTATE_CTRL.value


@cache
def _quiet() -> None:
    """No MUJOCO_LOG.TXT in the current directory, no warning on the console."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    mujoco.MjLogConfig.set(config)


@dataclass(frozen=True, eq=False)
class Compiled:
    """A compiled model with work space for any number of threads.

    Attributes:
        model: shared, never written to.
        hidden: actuators that effects have put behind the robot's own, each with one
            state. Nobody controls them, and `Motion.states` leaves theirs out.
    """

    model: mujoco.MjModel
    hidden: int = 0
    _spare: list[mujoco.MjData] = field(default_factory=list)

    def take(self) -> mujoco.MjData:
        """Work space that no other thread has; give it back when done."""
        try:
            return self._spare.pop()
        except IndexError:
            return mujoco.MjData(self.model)

    def give_back(self, data: mujoco.MjData) -> None:
        """Keep work space for the next job."""
        self._spare.append(data)


class Segment(NamedTuple):
    """A stretch of a trial under one model: controls, shape ``(S, nu)``."""

    compiled: Compiled
    control: np.ndarray


class Job(NamedTuple):
    """What one robot does.

    Attributes:
        start: full physics state (time, qpos, qvel, ...), shape ``(n,)``.
        segments: in order of time; the states go through.
        warm: where the solver and hidden actuators start, as the `Motion` before left
            them: with it a motion goes on to the same bytes. None = from scratch.
        out: where the states are to be written, as `Motion.states`; None = anywhere.
    """

    start: np.ndarray
    segments: tuple[Segment, ...]
    warm: np.ndarray | None = None
    out: np.ndarray | None = None


class Motion(NamedTuple):
    """What became of it.

    Attributes:
        states: full physics states, shape ``(S + 1, n)``, the start included; NaN from
            `diverged` on.
        diverged: index of the first state that is not valid; -1 = all are.
        warm: where the solver goes on, shape ``(nv,)``, and after it hidden actuators.
    """

    states: np.ndarray
    diverged: int
    warm: np.ndarray | None = None


def run(job: Job) -> Motion:
    """Roll out one robot.

    MuJoCo resets a simulation that diverges and goes on; `mujoco.rollout` then repeats
    the last state. Such a job is cut there and its remaining states are NaN.
    """
    _quiet()
    states = job.out
    if states is None:
        total = sum(len(segment.control) for segment in job.segments)
        states = np.empty((total + 1, len(job.start)))
    states[0] = job.start
    warm, inner, at = job.warm, np.zeros(0), 0
    roller = Rollout()
    for compiled, control in job.segments:
        data = compiled.take()
        count, nv = len(control), compiled.model.nv
        part = whole = states[at : at + 1 + count]
        if warm is not None:
            warm, inner = warm[None, :nv], warm[nv:]
        if compiled.hidden:
            control = np.hstack([control, np.zeros((count, compiled.hidden))])
            whole = np.hstack([part, np.zeros((count + 1, compiled.hidden))])
            if len(inner) == compiled.hidden:
                whole[0, part.shape[1] :] = inner
        roller.rollout(
            [compiled.model],
            [data],
            whole[:1],
            control[None],
            control_spec=CONTROL,
            skip_checks=True,
            nstep=count,
            initial_warmstart=warm,
            state=whole[None, 1:],
        )
        if compiled.hidden:
            part[1:] = whole[1:, : part.shape[1]]
        warm = np.append(data.qacc_warmstart, whole[-1, part.shape[1] :])
        warned = bool(data.warning.number.any())
        compiled.give_back(data)
        bad = _first_bad(states[at : at + 1 + count], warned)
        if bad >= 0:
            states[at + bad :] = np.nan
            return Motion(states, at + bad)
        at += count
    return Motion(states, -1, warm)


def _first_bad(states: np.ndarray, warned: bool) -> int:
    """Index of the first invalid state of a segment; -1 = none is."""
    if not warned and np.isfinite(states[-1]).all():
        return -1
    finite = np.isfinite(states).all(axis=1)
    forward = np.diff(states[:, 0], prepend=-np.inf) > 0
    bad = np.flatnonzero(~(finite & forward))
    if not len(bad):
        return len(states) - 1
    # A reset simulation restarts at time 0 and has made one step when it is seen. In
    # the first two steps that looks like going on: then the first is not trusted.
    return 1 if bad[0] == 2 else int(bad[0])


class Pool:
    """Threads that roll out jobs.

    Args:
        threads: how many at most.
    """

    def __init__(self, threads: int):
        self.threads = threads
        self._executor: ThreadPoolExecutor | None = None

    def map(self, jobs: Sequence[Job]) -> list[Motion]:
        """Roll out all jobs; the result depends on neither order nor threads."""
        if self.threads == 1 or len(jobs) < 2:
            return [run(job) for job in jobs]
        if self._executor is None:
            self._executor = ThreadPoolExecutor(self.threads - 1)
        done: list = [None] * len(jobs)
        todo = iter(range(len(jobs)))  # its next number goes to one thread only

        def work() -> None:
            for number in todo:
                done[number] = run(jobs[number])

        others = min(self.threads, len(jobs)) - 1
        helpers = [self._executor.submit(work) for _ in range(others)]
        work()
        for helper in helpers:
            helper.result()
        return done


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
