"""A wheeled robot as a nominal model for the diagnosis."""

import hashlib
from collections import OrderedDict
from collections.abc import Mapping, Sequence

import numpy as np

from bns import models
from bns.errors import BnsError
from bns.gap import wheeled_library
from bns.gap.model import Windows
from bns.gap.records import Candidate
from bns.gap.reduced import reduced
from bns.worlds import compile, control, observe
from bns.worlds.active import Placed
from bns.worlds.effects.base import Effect, PoseSignal
from bns.worlds.physics import Job, Pool
from bns.worlds.trial import POSE_CHANNELS, Channel, Trial

EVERY = 2  # physics steps between kept poses
KEPT = 40_000  # simulated drives kept in memory, about 24 kB each
WINDOW = 0.1  # [s] shortest piece of motion that is compared
ABSOLUTE = ("floor_slope",)  # effects that tell one heading in the world from another
FAR = np.inf


class WheeledModel:
    """A differential-drive robot in MuJoCo, seen by an overhead tracker.

    Args:
        robot: name of the robot model, of kind "wheeled".
        threads: of the physics.
        process: see `GapModel.process` [m, m, rad per square root of a second].
        resolution: see `GapModel.resolution` [m, m, rad].
        exact: simulate everything in full, never by the reduced dynamics.

    Raises:
        BnsError: the robot has no wheels.
    """

    channels = POSE_CHANNELS
    features = (Channel("forward", "m"), Channel("left", "m"), Channel("turn", "rad"))

    def __init__(
        self,
        robot: str = "khepera3",
        *,
        threads: int = 2,
        process: Sequence[float] = (2e-4, 1e-4, 2e-3),
        resolution: Sequence[float] = (1e-4, 1e-4, 1e-3),
        exact: bool = False,
    ):
        self._robot = models.robot(robot)
        if self._robot.kind != "wheeled":
            raise BnsError(f"{robot!r} has no wheels; take a wheeled robot.")
        self.name, self.exact = robot, exact
        self.process = np.array(process, dtype=float)
        self.resolution = np.array(resolution, dtype=float)
        self._pool = Pool(threads)
        self._cache: OrderedDict[tuple, np.ndarray] = OrderedDict()

    @property
    def dt(self) -> float:
        """Physics step [s]."""
        return float(compile.compiled(self.name).model.opt.timestep)

    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates of a wheeled robot."""
        return wheeled_library.candidates()

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """Predicted poses, see `GapModel.simulate`."""
        keys = {}
        for place, items in enumerate(effects):
            for number, trial in enumerate(trials):
                keys[place, number] = self._key(trial, items)
        wanted: dict[tuple, tuple[Trial, Sequence[Effect]]] = {}
        for (place, number), key in keys.items():
            if key not in self._cache:
                wanted.setdefault(key, (trials[number], effects[place]))
        made = self._run(wanted)
        return [
            [
                self._tracked(trial, items, self._recall(keys[place, number], made))
                for number, trial in enumerate(trials)
            ]
            for place, items in enumerate(effects)
        ]

    def _recall(self, key: tuple, made: Mapping[tuple, np.ndarray]) -> np.ndarray:
        if key in made:
            return made[key]
        self._cache.move_to_end(key)
        return self._cache[key]

    def _key(self, trial: Trial, effects: Sequence[Effect]) -> tuple:
        moving = tuple(str(e) for e in effects if e.stage != "tracking")
        absolute = any(e.name in ABSOLUTE for e in effects)
        yaw = float(_start(trial)[2]) if absolute else 0.0
        told = trial.commands.values.tobytes() + trial.commands.durations.tobytes()
        return hashlib.blake2b(told, digest_size=16).digest(), moving, yaw

    def _run(self, wanted: Mapping[tuple, tuple]) -> dict[tuple, np.ndarray]:
        """Poses from the origin, every `EVERY` steps, ``(S, 3)`` by key."""
        groups: dict[tuple, list] = {}
        jobs, owners = [], []
        for key, (trial, items) in wanted.items():
            told, body = self._told(trial, items), self._body(items)
            fast = not (self.exact or key[2] or any(e.name in ABSOLUTE for e in body))
            if fast and reduced(self.name, body, self._robot.ctrl_per_command).good:
                groups.setdefault((body, len(told)), []).append((key, told))
            else:
                jobs.append(self._job(told, body, key[2]))
                owners.append(key)
        made = {}
        for (body, _), members in groups.items():
            fast = reduced(self.name, body, self._robot.ctrl_per_command)
            poses = fast.poses(np.stack([told for _, told in members]))
            for (key, _), pose in zip(members, poses[:, ::EVERY], strict=True):
                made[key] = pose.copy()
        for key, motion in zip(owners, self._pool.map(jobs), strict=True):
            place = compile.free_joint(compile.compiled(self.name).model)
            free = motion.states[:, 1 + place.start : 1 + place.stop]
            made[key] = observe.planar(free, key[2])[::EVERY].copy()
        self._cache.update(made)
        while len(self._cache) > KEPT:
            self._cache.popitem(last=False)
        return made

    def _told(self, trial: Trial, effects: Sequence[Effect]) -> np.ndarray:
        counts = control.steps(trial.commands.durations, self.dt)
        given = control.signal(trial.commands, counts, self.dt)
        placed = [
            Placed(effect, 0.0, FAR, ("gap", effect.name, number))
            for stage in ("command", "actuator")
            for number, effect in enumerate(effects)
            if effect.stage == stage
        ]
        return control.disturbed(given, placed, 0, 0)

    @staticmethod
    def _body(effects: Sequence[Effect]) -> tuple:
        return tuple(e for e in effects if e.stage == "body" and not e.is_nominal)

    def _job(self, told: np.ndarray, body: tuple, yaw: float) -> Job:
        values = told * self._robot.ctrl_per_command
        placed = tuple(Placed(effect, 0.0, FAR, ()) for effect in body)
        segments = compile.segments(self.name, placed, values, self.dt)
        begin = compile.start_state(segments[0].compiled, (0.0, 0.0, yaw))
        return Job(begin, segments)

    def _tracked(
        self, trial: Trial, effects: Sequence[Effect], poses: np.ndarray
    ) -> np.ndarray:
        """Poses put at the recorded start, through the tracker, at the samples."""
        times = np.arange(len(poses)) * self.dt * EVERY
        poses = _moved(poses, _start(trial))
        stamps, seen = times, poses
        for effect in effects:
            if effect.stage == "tracking":
                signal = PoseSignal(stamps, seen, times, poses)
                rng = np.random.default_rng(0)
                on = np.ones(len(stamps), dtype=bool)
                stamps, seen = effect.apply(signal, on, rng)
        at = trial.times - trial.times[trial.boundaries[0]]
        return np.stack([np.interp(at, stamps, axis) for axis in seen.T], axis=1)

    def windows(self, trial: Trial) -> Windows:
        """Windows between samples that were seen, `WINDOW` long or more."""
        return windows(trial, WINDOW)

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """Displacement in the robot's frame at the start of each window."""
        begin, end = observed[..., windows.first, :], observed[..., windows.last, :]
        step = end - begin
        cos, sin = np.cos(begin[..., 2]), np.sin(begin[..., 2])
        forward = cos * step[..., 0] + sin * step[..., 1]
        left = cos * step[..., 1] - sin * step[..., 0]
        return np.stack([forward, left, step[..., 2]], axis=-1)

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """Commands, their signs, changes, pose and time in each window."""
        ends = np.cumsum(trial.commands.durations)
        at = windows.times - trial.times[trial.boundaries[0]]
        index = np.minimum(np.searchsorted(ends, at), len(ends) - 1)
        told = trial.commands.values
        before = np.vstack([np.zeros(2), told])[index]
        pose = trial.poses_world[windows.first]
        now = told[index]
        return {
            "speed told to the left wheel": now[:, 0],
            "speed told to the right wheel": now[:, 1],
            "change of the left wheel's command": now[:, 0] - before[:, 0],
            "change of the right wheel's command": now[:, 1] - before[:, 1],
            "time since the command changed": at
            - (ends - trial.commands.durations)[index],
            "forward speed told": now.mean(axis=1),
            "turn told": now[:, 1] - now[:, 0],
            "heading": np.angle(np.exp(1j * pose[:, 2])),
            "x": pose[:, 0],
            "y": pose[:, 1],
            "time in the trial": at,
        }


def windows(trial: Trial, length: float) -> Windows:
    """Windows of at least a length [s] that tile a trial, between seen samples.

    Args:
        trial: recorded trial.
        length: infinity = one window, from the first sample to the last.
    """
    seen = np.flatnonzero(np.isfinite(trial.observed).all(axis=1))
    seen = seen[seen >= trial.boundaries[0]]
    if np.isinf(length):
        marks = seen[[0, -1]] if len(seen) > 1 else seen[:0]
    else:
        kept = list(seen[:1])
        for sample in seen[1:]:
            if trial.times[sample] - trial.times[kept[-1]] >= 0.95 * length:
                kept.append(sample)
        marks = np.array(kept, dtype=int)
    first, last = marks[:-1], marks[1:]
    begin, end = trial.times[first], trial.times[last]
    return Windows(first, last, (begin + end) / 2, end - begin)


def _start(trial: Trial) -> np.ndarray:
    pose = trial.poses_world[trial.boundaries[0]]
    if np.isfinite(pose).all():
        return pose
    seen = np.isfinite(trial.poses_world).all(axis=1)
    return trial.poses_world[seen][0]


def _moved(poses: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Poses as if they had begun at `start`."""
    turn = start[2] - poses[0, 2]
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = (poses[:, :2] - poses[0, :2]).T
    return np.column_stack(
        [start[0] + cos * x - sin * y, start[1] + sin * x + cos * y, poses[:, 2] + turn]
    )
