"""A wheeled robot as a nominal model for the diagnosis."""

import hashlib
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from weakref import WeakKeyDictionary

import numpy as np

from bns import models
from bns.errors import BnsError
from bns.gap.candidates import wheeled, wheeled_rows
from bns.gap.decomposition.model import DecomposableModel
from bns.gap.decomposition.row import Row
from bns.gap.models import planar_rollout, wheeled_drives
from bns.gap.models.base import Windows
from bns.gap.models.planar_rollout import EVERY
from bns.gap.models.surrogate import STEEPEST, Reduced, between, reduced
from bns.gap.recordings import segments as pieces
from bns.gap.recordings.segments import (
    WHOLE,
    Piece,
    moved,
    pieces_of,
    stitched,
    windows,
)
from bns.gap.records import Candidate
from bns.worlds.active import Placed
from bns.worlds.effects.base import ControlSignal, Effect, PoseSignal
from bns.worlds.physics import compile, control, observe
from bns.worlds.physics.rollout import Job, Pool
from bns.worlds.trial import (
    POSE_CHANNELS,
    Channel,
    Commands,
    Trial,
    body_displacement,
)

KEPT = 40_000  # simulated drives kept in memory, about 24 kB each
WINDOW = 0.1  # [s] shortest piece of motion that is compared
HORIZON = 0.4  # [s] over which motion is compared in the joint fit, half overlapping
LEAST = (2e-4, 2e-4, 1e-3)  # [m, m, rad] smallest believed deviations over it; assumed
ABSOLUTE = ("floor_slope",)  # effects that tell one heading in the world from another
FAR = np.inf
AT_ONCE = 600  # drives that are computed together


class WheeledModel(DecomposableModel):
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
        process: Sequence[float] = (1e-4, 5e-5, 1e-3),
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
        self._drives = wheeled_drives.Drives(robot, self._pool)
        self._cache: OrderedDict[tuple, np.ndarray] = OrderedDict()
        self._given: WeakKeyDictionary[Commands, ControlSignal] = WeakKeyDictionary()

    @property
    def dt(self) -> float:
        """Physics step [s]."""
        return float(compile.compiled(self.name).model.opt.timestep)

    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates of a wheeled robot."""
        return wheeled.candidates()

    @property
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of each feature [m, m, rad]."""
        return np.array(LEAST)

    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """All numbers of a wheeled robot that may be off."""
        return wheeled_rows.rows(trials)

    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """See `DecomposableModel.paths`: poses, each ``(T, 3)`` [m, m, rad]."""
        return self._drives.paths(trials, sets, fine=fine)

    def joint_windows(self, trial: Trial) -> Windows:
        """Windows of `HORIZON` between seen samples, half overlapping."""
        return pieces.overlapping(trial, HORIZON)

    def motion(self, features: np.ndarray) -> np.ndarray:
        """Speed of each feature over a window."""
        return np.abs(features) / HORIZON

    def effect(self, term: str, values: Mapping[str, float]) -> Effect:
        """The effect of an explanation."""
        return wheeled_drives.effect(term, values)

    @staticmethod
    def steps(candidate: Candidate, trials: Sequence[Trial]) -> tuple[float, ...]:
        """Widths of a dead band, one between each two speeds that were told."""
        return wheeled.steps(candidate, trials)

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: predicted poses, each ``(T, 3)`` [m, m, rad]."""
        return self._simulated(trials, effects, rough=False)

    def sketch(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """As `simulate`, each ``(T, 3)``, by the reduced dynamics where they do."""
        return self._simulated(trials, effects, rough=True)

    def _simulated(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]], rough: bool
    ) -> list[list[np.ndarray]]:
        keys = {}
        quick = rough and not self.exact
        ways = [self._learnt(self._body(e)) if quick else None for e in effects]
        for place, items in enumerate(effects):
            for number, trial in enumerate(trials):
                keys[place, number] = (*self._key(trial, items), ways[place])
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

    @staticmethod
    def _key(trial: Trial, effects: Sequence[Effect]) -> tuple:
        moving = tuple(str(e) for e in effects if e.stage != "tracking")
        seen = trial.observed.tobytes() if _absolute(effects) else b""
        told = trial.commands.values.tobytes() + trial.commands.durations.tobytes()
        return hashlib.blake2b(told + seen, digest_size=16).digest(), moving

    def _run(self, wanted: Mapping[tuple, tuple]) -> dict[tuple, np.ndarray]:
        """Poses from the origin, every `EVERY` steps, ``(S, 3)`` by key."""
        quick: list[tuple] = []
        jobs: list[Job] = []
        slow: dict[tuple, list] = {}
        for key, (trial, items) in wanted.items():
            told, body, learnt = self._told(trial, items), self._body(items), key[-1]
            if learnt is not None:
                quick.append((key, learnt, told, self._pull(trial, body, len(told))))
                continue
            cut = pieces_of(trial, len(told), self.dt) if _absolute(items) else [WHOLE]
            slow[key] = [(len(jobs) + n, piece) for n, piece in enumerate(cut)]
            jobs += [self._job(told, body, piece) for piece in cut]
        made = {}
        for at in range(0, len(quick), AT_ONCE):
            keys, maps, told, pulls = zip(*quick[at : at + AT_ONCE], strict=True)
            halves = [planar_rollout.halved(values) for values in told]
            made.update(
                zip(keys, planar_rollout.poses(maps, halves, pulls), strict=True)
            )
        place = compile.free_joint(compile.compiled(self.name).model)
        free = slice(1 + place.start, 1 + place.stop)
        rolled = [motion.states[:, free] for motion in self._pool.map(jobs)]
        for key, parts in slow.items():
            poses = [
                observe.planar(rolled[number], piece.yaw)[piece.lead :]
                for number, piece in parts
            ]
            made[key] = pieces.thinned(stitched(poses))
        self._cache.update(made)
        while len(self._cache) > KEPT:
            self._cache.popitem(last=False)
        return made

    def _learnt(self, body: tuple) -> planar_rollout.Map | None:
        """The reduced dynamics of a robot, None where they do not do."""
        level = tuple(effect for effect in body if effect.name not in ABSOLUTE)
        steepest = sum(e["angle"] for e in body if e.name in ABSOLUTE)
        if steepest > STEEPEST:
            return None
        found = self._reduced(level, slopes=steepest > 0)
        return found.map if found.rough else None

    def _reduced(self, body: tuple, *, slopes: bool = False) -> Reduced:
        per_command = self._robot.ctrl_per_command
        if len(body) == 1:
            return between(self.name, body[0], per_command, slopes=slopes)
        whole = reduced(self.name, (), per_command, slopes=slopes)
        if not body:
            return whole
        parts = [between(self.name, e, per_command, slopes=slopes) for e in body]
        maps = [whole.map, *(part.map for part in parts)]
        summed = planar_rollout.mixed(maps, [1 - len(parts), *[1] * len(parts)])
        return Reduced(summed, max(1.0, *(part.error for part in parts)))

    def _pull(self, trial: Trial, body: tuple, steps: int) -> np.ndarray | None:
        """Gravity along the heading that was observed; None on a level floor."""
        if not _absolute(body):
            return None
        down = np.linalg.norm(compile.compiled(self.name).model.opt.gravity)
        gravity = np.zeros(3)
        for effect in body:
            if effect.name in ABSOLUTE:
                along = -down * np.sin(effect["angle"])
                gravity[0] += along * np.cos(effect["direction"])
                gravity[1] += along * np.sin(effect["direction"])
        times = np.arange(0, steps, EVERY) * self.dt
        yaw = trial.channel("yaw")
        seen = np.isfinite(yaw)
        stamps = trial.times[seen] - trial.times[trial.boundaries[0]]
        return planar_rollout.pull(np.interp(times, stamps, yaw[seen]), gravity)

    def _told(self, trial: Trial, effects: Sequence[Effect]) -> np.ndarray:
        given = self._given.get(trial.commands)
        if given is None:
            counts = control.steps(trial.commands.durations, self.dt)
            given = control.signal(trial.commands, counts, self.dt)
            self._given[trial.commands] = given
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

    def _job(self, told: np.ndarray, body: tuple, piece: Piece) -> Job:
        values = told[piece.first : piece.last] * self._robot.ctrl_per_command
        placed = tuple(Placed(effect, 0.0, FAR, ()) for effect in body)
        segments = compile.segments(self.name, placed, values, self.dt)
        begin = compile.start_state(segments[0].compiled, (0.0, 0.0, piece.yaw))
        return Job(begin, segments)

    def _tracked(
        self, trial: Trial, effects: Sequence[Effect], poses: np.ndarray
    ) -> np.ndarray:
        """Poses put at the recorded start, through the tracker, at the samples."""
        every = self.dt * EVERY
        at = trial.times - trial.times[trial.boundaries[0]]
        tracking = [effect for effect in effects if effect.stage == "tracking"]
        if not tracking:
            place = np.clip(at / every, 0.0, len(poses) - 1.0)
            before = np.minimum(place.astype(int), len(poses) - 2)
            share = (place - before)[:, None]
            seen = (1 - share) * poses[before] + share * poses[before + 1]
            return moved(seen, _start(trial), origin=poses[0])
        times = np.arange(len(poses)) * every
        poses = moved(poses, _start(trial))
        stamps, seen = times, poses
        for effect in tracking:
            signal = PoseSignal(stamps, seen, times, poses)
            rng = np.random.default_rng(0)
            on = np.ones(len(stamps), dtype=bool)
            stamps, seen = effect.apply(signal, on, rng)
        return np.stack([np.interp(at, stamps, axis) for axis in seen.T], axis=1)

    def windows(self, trial: Trial) -> Windows:
        """Windows between samples that were seen, `WINDOW` long or more."""
        return windows(trial, WINDOW)

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """See `GapModel.compare`: displacement in each window's first frame."""
        begin, end = observed[..., windows.first, :], observed[..., windows.last, :]
        return body_displacement(begin, end)

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """Commands, their signs, changes, pose and time in each window."""
        index, since, at = pieces.told(trial, windows)
        told = trial.commands.values
        before = np.vstack([np.zeros(2), told])[index]
        pose = pieces.coarse(trial.poses_world[windows.first])
        now = told[index]
        return {
            "speed told to the left wheel [m/s]": now[:, 0],
            "speed told to the right wheel [m/s]": now[:, 1],
            "change of the left wheel's command [m/s]": now[:, 0] - before[:, 0],
            "change of the right wheel's command [m/s]": now[:, 1] - before[:, 1],
            "time since the command changed [s]": since,
            "forward speed told [m/s]": now.mean(axis=1),
            "turn told [m/s]": now[:, 1] - now[:, 0],
            "heading": np.angle(np.exp(1j * pose[:, 2])),
            "x [m]": pose[:, 0],
            "y [m]": pose[:, 1],
            "time in the trial [s]": at,
        }


def _absolute(effects: Sequence[Effect]) -> bool:
    return any(effect.name in ABSOLUTE for effect in effects)


def _start(trial: Trial) -> np.ndarray:
    pose = trial.poses_world[trial.boundaries[0]]
    if np.isfinite(pose).all():
        return pose
    seen = np.isfinite(trial.poses_world).all(axis=1)
    return trial.poses_world[seen][0]
