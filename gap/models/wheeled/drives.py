"""Drives of a wheeled robot with any of its numbers changed, by MuJoCo itself."""

import hashlib
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bns import models
from bns.gap.candidates.wheeled_rows import LEAD
from bns.gap.models.wheeled.changes import Changes
from bns.gap.recordings import trial_conditions
from bns.gap.recordings.segments import moved
from bns.worlds.effects.base import CommandEffect, ControlSignal, Effect, ModelEdit
from bns.worlds.physics import compile, observe
from bns.worlds.physics.rollout import Job, Pool, Segment
from bns.worlds.trial import Commands, Trial

FINE, COARSE = 0.002, 0.005  # [s] physics steps: of residuals, of differences
KEPT = 0.01  # [s] between two poses that are kept
DRIVES = 8_000  # kept, about 24 kB each
AFTER = 0.05  # [s] that are simulated beyond the last command
RESTING = 0.2  # [s] over which the pose at the start is the median of what was seen
SWITCHING = ("dead_band", "dead_zone", "speed_saturation", "wheel_stuck_max",
             "wheel_stuck_min", "wheel_intermittent")  # fmt: skip


@lru_cache(maxsize=512)
def begun(robot: str, body: tuple[ModelEdit, ...], dt: float, yaw: float) -> np.ndarray:
    """Full physics state at rest at the origin with a heading. On a level floor a robot
    comes to rest alike at every heading.

    Args:
        robot: by name.
        body: edits of the model, applied in order.
        dt: physics step [s].
        yaw: the heading [rad].
    """
    compiled = compile.compiled(robot, body, dt)
    if np.any(compiled.model.opt.gravity[:2]):
        return compile.start_state(compiled, (0.0, 0.0, yaw))
    state = compile.start_state(compiled, (0.0, 0.0, 0.0)).copy()
    place = compile.free_joint(compiled.model)
    free = slice(1 + place.start, 1 + place.stop)
    state[free] = compile.posed(state[free], (0.0, 0.0, yaw))
    return state


class Drives:
    """Simulates drives, keeping what was simulated.

    Args:
        robot: name of the robot model.
        pool: threads of the physics.
    """

    def __init__(self, robot: str, pool: Pool):
        self.robot, self._pool = robot, pool
        self._per_command = models.robot(robot).ctrl_per_command
        self._cache: OrderedDict[bytes, np.ndarray] = OrderedDict()

    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """See `GapModel.paths`: poses, each ``(T, 3)`` [m, m, rad]."""
        changes = [[Changes.of(values, self.robot) for values in row] for row in sets]
        return self._driven(trials, changes, FINE if fine else COARSE)

    def with_effects(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: poses, each ``(T, 3)`` [m, m, rad]."""
        numbers = trial_conditions.numbers(trials)
        changes = [
            [Changes.by_effects(items, number) for number in numbers]
            for items in effects
        ]
        return self._driven(trials, changes, FINE)

    def _driven(
        self,
        trials: Sequence[Trial],
        changes: Sequence[Sequence[Changes]],
        dt: float,
    ) -> list[list[np.ndarray]]:
        starts = [start(trial) for trial in trials]
        drives = [list(zip(trials, row, starts, strict=True)) for row in changes]
        jobs = [[_Drive.of(*drive, dt) for drive in row] for row in drives]
        keys = [[job.key for job in row] for row in jobs]
        wanted = {
            job.key: job for row in jobs for job in row if job.key not in self._cache
        }
        made = self._run(wanted, dt)
        paths = [
            [
                tracked(drive[0], self._recall(key, made), drive[1].seen, drive[2])
                for key, drive in zip(names, row, strict=True)
            ]
            for names, row in zip(keys, drives, strict=True)
        ]
        while len(self._cache) > DRIVES:
            self._cache.popitem(last=False)
        return paths

    def _recall(self, key: bytes, made: Mapping[bytes, np.ndarray]) -> np.ndarray:
        if key in made:
            return made[key]
        self._cache.move_to_end(key)
        return self._cache[key]

    def _run(
        self, wanted: Mapping[bytes, "_Drive"], dt: float
    ) -> dict[bytes, np.ndarray]:
        """Poses from the origin every `KEPT` seconds, ``(S, 3)`` by key."""
        every = round(KEPT / dt)
        jobs = []
        for drive in wanted.values():
            compiled = compile.compiled(self.robot, drive.body, dt)
            state = begun(self.robot, drive.body, dt, drive.yaw)
            segment = Segment(compiled, drive.speeds * self._per_command)
            jobs.append(Job(state, (segment,)))
        place = compile.free_joint(compile.compiled(self.robot, (), dt).model)
        free = slice(1 + place.start, 1 + place.stop)
        made = {
            drive.key: observe.planar(path.states[:, free], drive.yaw)[::every].copy()
            for drive, path in zip(wanted.values(), self._pool.map(jobs), strict=True)
        }
        self._cache.update(made)
        return made


def heading(changes: Changes, begin: np.ndarray) -> float:
    """Heading in the world at which a drive is simulated: a slope tells headings apart,
    and so does the friction of wheels that slide (MuJoCo's pyramidal cone)."""
    return round(float(begin[2] - changes.seen.get("marker_mount.yaw", 0.0)), 4)


@dataclass(frozen=True, eq=False)
class _Drive:
    """All that a simulated drive depends on: commands that effects leave as they are
    make no other drive.

    Attributes:
        body: edits of the model, applied in order.
        speeds: of both wheels at each physics step, ``(S, 2)`` [m/s].
        yaw: heading at the start [rad].
        key: the same for equal drives.
    """

    body: tuple[ModelEdit, ...]
    speeds: np.ndarray
    yaw: float
    key: bytes

    @classmethod
    def of(
        cls, trial: Trial, changes: Changes, begin: np.ndarray, dt: float
    ) -> "_Drive":
        """The drive of a trial with some numbers changed.

        Args:
            trial: recorded trial.
            changes: the numbers.
            begin: pose seen at the start, ``(3,)`` [m, m, rad].
            dt: physics step [s].
        """
        yaw = heading(changes, begin)
        speeds = told(trial.commands, changes.command, dt, changes.late)
        speeds = speeds * (1 - changes.lost)
        digest = hashlib.blake2b(speeds.tobytes(), digest_size=16)
        words = [*map(str, changes.body), repr(yaw), repr(dt)]
        digest.update(";".join(words).encode())
        return cls(changes.body, speeds, yaw, digest.digest())


def start(trial: Trial) -> np.ndarray:
    """Pose seen at the start, ``(3,)``."""
    seen = np.flatnonzero(np.isfinite(trial.observed[:, :3]).all(axis=1))
    seen = seen[seen >= trial.boundaries[0]]
    times = trial.times[seen]
    count = max(3, int((times < times[0] + RESTING).sum()))
    return np.median(trial.observed[seen[:count], :3], axis=0)


def told(
    commands: Commands,
    effects: Sequence[CommandEffect],
    dt: float,
    late: float = 0.0,
) -> np.ndarray:
    """Speeds told to both wheels at each physics step after effects, ``(S, 2)``.

    A step in which a command ends gets the mean of both by their time, unless an effect
    switches at a speed.

    Args:
        commands: wheel speeds [m/s] and how long each is held.
        effects: on commands and actuators, applied in order.
        dt: physics step [s].
        late: by how much all comes late [s].
    """
    begins = np.concatenate([[0.0], np.cumsum(commands.durations)])
    count = int(np.ceil(begins[-1] / dt)) + 1 + round(AFTER / dt)
    begins = begins + late
    at = np.arange(count) * dt
    index = np.searchsorted(begins, at + dt / 2, side="right") - 1
    index = np.where(index >= len(commands), -1, index)
    held = np.where((index >= 0)[:, None], commands.values[np.maximum(index, 0)], 0.0)
    values = held
    if not any(item.name in SWITCHING for item in effects):
        values = _averaged(commands, begins, np.append(at, at[-1] + dt), held)
    signal = ControlSignal(at, values, index, ("left_speed", "right_speed"), dt)
    rng, on = np.random.default_rng(0), np.ones(count, dtype=bool)
    for item in effects:
        values = item.apply(signal, on, rng)
        signal = ControlSignal(at, values, index, signal.channels, dt)
    return signal.values


def _averaged(
    commands: Commands, begins: np.ndarray, edges: np.ndarray, held: np.ndarray
) -> np.ndarray:
    way = np.cumsum(commands.values * commands.durations[:, None], axis=0)
    way = np.concatenate([np.zeros((1, 2)), way])
    area = np.stack([np.interp(edges, begins, column) for column in way.T], axis=1)
    mean = np.diff(area, axis=0) / np.diff(edges)[:, None]
    same = np.abs(mean - held).max(axis=1) < 1e-9
    return np.where(same[:, None], held, mean)


def tracked(
    trial: Trial, poses: np.ndarray, seen: Mapping[str, float], begin: np.ndarray
) -> np.ndarray:
    """A path as the tracker would have shown it, ``(T, 3)``.

    Args:
        trial: recorded trial.
        poses: every `KEPT` seconds.
        seen: what the tracker does, by row.
        begin: pose seen at the start.
    """
    turned = seen.get("marker_mount.yaw", 0.0)
    path = moved(poses, begin - np.array([0.0, 0.0, turned]))
    at = trial.times - trial.times[trial.boundaries[0]]
    at = at / (1 + seen.get("clock_drift", 0.0)) + seen.get(LEAD, 0.0)
    at = at - seen.get("tracker_latency", 0.0)
    grid = np.arange(len(path)) * KEPT
    made = np.stack([np.interp(at, grid, column) for column in path.T], axis=1)
    cos, sin = np.cos(made[:, 2]), np.sin(made[:, 2])
    dx, dy = seen.get("marker_mount.dx", 0.0), seen.get("marker_mount.dy", 0.0)
    made[:, 0] += cos * dx - sin * dy
    made[:, 1] += sin * dx + cos * dy
    made[:, 2] += turned
    made[:, :2] *= seen.get("tracker_scale", 1.0)
    return made
