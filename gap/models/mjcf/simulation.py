"""The physics of a description: trials run under effects, and what was run is kept."""

import itertools
import math
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import zip_longest
from typing import NamedTuple

import mujoco
import numpy as np

from bns.errors import FormatError
from bns.gap.models.mjcf import command_steps, floating, prepared, start, trees
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.loads import Loads
from bns.gap.models.mjcf.view import View
from bns.models import mjcf as mjcf_file
from bns.worlds.effects.base import (
    CommandEffect,
    Effect,
    ModelEdit,
    PoseSignal,
    SensorEffect,
    TrackingEffect,
)
from bns.worlds.physics.rollout import STATE, Compiled, Job, Pool, Segment
from bns.worlds.trial import Trial

KEPT, MODELS = 20_000, 300  # simulated trials and compiled models kept in memory
READ = 2**28  # bytes of what sensors would read that are kept
FINE = 0.005  # [s] between kept states; the step if that is longer
FINEST, CUT = 0.0025, 4  # [s] longer steps are cut, shorter ones in so many parts
PACES = (1 / 8, 1 / 4, 1 / 2)  # of a step into parts: so many steps in one
EXACT = 0.2  # of the noise: predictions that differ by less are alike
BY_GEOMS = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
CHATTER = 0.8  # times what a step half as fine changed: it should be half
TRIED = 4  # trials on which steps are compared, and forces and contacts looked at
LOOKED = 500  # moments of a trial at which these are looked at


class _Group(NamedTuple):
    """Simulations of a trial under the same effects on all trees, and what is missing:
    by the columns of a tree its pieces by key."""

    trial: Trial
    common: tuple[Effect, ...]
    lead: float
    missing: dict[tuple[int, ...], dict[tuple, trees.Piece]]


class Simulation:
    """Runs recorded commands on a described robot again.

    Args:
        config: the description.
        threads: of the physics.

    Attributes:
        dt: step of the model [s].
        actuators: number of each command channel's actuator.
        finest: into how many parts a step is cut at most.
        paces: parts, below 1, of steps that are longer than the model's, up to `FINE`.

    Raises:
        FormatError: the MJCF file is missing or MuJoCo refuses it.
        UnknownNameError: a part that the model lacks.
    """

    def __init__(self, config: OwnConfig, *, threads: int = 2):
        self.config = config
        self._pool = Pool(threads)
        self._compiled: OrderedDict[tuple, Compiled] = OrderedDict()
        self._kept: OrderedDict[tuple, np.ndarray] = OrderedDict()
        self._motions: OrderedDict[tuple, np.ndarray] = OrderedDict()
        self._trees = trees.Trees.one(config)
        model = self.model
        self.config = config = floating.told(config, model)
        self.dt = float(model.opt.timestep)
        self.finest = max(math.ceil(self.dt / FINEST - 1e-9), CUT)
        longer = (FINE / self.dt >= 1 / each - 1e-9 for each in PACES)
        self.paces = tuple(itertools.compress(PACES, longer))
        self.actuators = [
            prepared.number(model, "actuator", t.actuator) for t in config.told
        ]
        if config.keyframe:
            prepared.number(
                model, "key", config.keyframe
            )  # there, before anything runs
        self._views = {model.names: View.of(config, model)}
        self.starts = start.Starts(config, model, self._view)

    @property
    def model(self) -> mujoco.MjModel:
        """The nominal model, compiled."""
        return self.compiled(()).model

    def _view(self, model: mujoco.MjModel) -> View:
        """Where the observed channels are in a model: play is a joint more."""
        if model.names not in self._views:
            self._views[model.names] = View.of(self.config, model)
        return self._views[model.names]

    def spec(self, effects: Sequence[Effect], *, held: bool = True) -> mujoco.MjSpec:
        """The model with the effects on its parts written into it.

        Args:
            effects: of any stage.
            held: whether bodies that a stand holds are fixed.

        Raises:
            FormatError: the MJCF file is missing or MuJoCo refuses it.
        """
        if not self.config.model.exists():
            raise FormatError(f"There is no model file {self.config.model}.")
        config = self.config if held else replace(self.config, held=())
        made = prepared.spec(config)
        model = mjcf_file.compiled(made, self.config.model)
        if effects and made.compiler.inertiafromgeom == BY_GEOMS:
            prepared.weighed(
                made, model
            )  # else what effects say of masses is not heard
        _edit(made, effects)
        return made

    @cached_property
    def _lean(self) -> mujoco.MjSpec:
        """The model without what only draws it."""
        return prepared.lean(self.spec(()))

    def compiled(self, effects: Sequence[Effect], parts: float = 1) -> Compiled:
        """The compiled model with the effects on its parts.

        Args:
            effects: of any stage.
            parts: into how many its step is cut; 1/2 = two in one.
        """
        body = tuple(str(e) for e in effects if e.stage == "body" and not e.is_nominal)
        key = (parts, *body)
        if key not in self._compiled:
            made = self._lean.copy()
            _edit(made, effects)
            model = made.compile()
            model.opt.timestep /= parts
            self._compiled[key] = Compiled(model)
            while len(self._compiled) > MODELS:
                self._compiled.popitem(last=False)
        self._compiled.move_to_end(key)
        return self._compiled[key]

    @staticmethod
    def some(trials: Sequence[Trial]) -> Sequence[Trial]:
        """A few trials of a recording, spread over it."""
        return trials[:: max(len(trials) // TRIED, 1)]

    def needed(self, trials: Sequence[Trial]) -> int:
        """Into how many parts a step has to be cut for the nominal motion of trials: as
        many as it takes until twice as many change next to nothing; one, where these
        change as much as half of them did: what wheels on their rims do is no nearer to
        any robot by finer steps."""
        noise = np.array([item.noise for item in self.config.seen])
        few = [(trial, ()) for trial in self.some(trials)]
        parts, made, before = 1, self.predicted(few), np.inf
        while parts < self.finest:
            finer = self.predicted(few, min(2 * parts, self.finest))
            pairs = zip(made, finer, strict=True)
            apart = np.concatenate([np.abs(a - b) for a, b in pairs]) / noise
            size = float(np.sqrt((np.nan_to_num(apart, nan=np.inf) ** 2).mean()))
            if size > CHATTER * before:
                return 1
            if (apart < EXACT).all():
                break
            parts, made, before = min(2 * parts, self.finest), finer, size
        return parts

    def loads(self, trials: Sequence[Trial]) -> Loads:
        """Forces, contacts and positions at moments of some of the trials, as the
        nominal model moves.

        Args:
            trials: recorded.
        """
        return Loads.of(self.model, self._moments(trials))

    def apart(self, loads: Loads) -> None:
        """From now on what trees of the model do is simulated apart, where they can not
        touch each other.

        Args:
            loads: of the nominal motion.
        """
        whole, model = trees.Trees.one(self.config), self.model
        self._trees = whole if loads.touching else trees.Trees.of(self.config, model)

    def _moments(self, trials: Sequence[Trial]) -> Iterator[mujoco.MjData]:
        """Moments of some trials of the nominal motion, all quantities computed; each
        is overwritten by the next."""
        model = self.model
        data = mujoco.MjData(model)
        for trial in self.some(trials):
            job = self._job(trial, (), 1)
            (motion,) = self._pool.map([job])
            control = job.segments[0].control
            every = max(1, len(control) // LOOKED)
            moments = zip(motion.states[:-1:every], control[::every], strict=True)
            for state, ctrl in moments:
                if np.isfinite(state).all():
                    mujoco.mj_setState(model, data, state, STATE)
                    data.ctrl[:] = ctrl
                    mujoco.mj_forward(model, data)
                    yield data

    def predicted(
        self,
        pairs: Sequence[tuple[Trial, Sequence[Effect]]],
        parts: float = 1,
        ahead: Sequence[float] | None = None,
    ) -> list[np.ndarray]:
        """Predicted samples of trials, each under effects of its own.

        Args:
            pairs: trials with their effects.
            parts: into how many a step is cut; 1/2 = two in one.
            ahead: seconds by which each motion is ahead of the trial's clock.
        """
        leads = [0.0] * len(pairs) if ahead is None else ahead
        found: dict[tuple, np.ndarray] = {}
        asked, groups = [], dict[tuple, _Group]()
        for (trial, items), lead in zip(pairs, leads, strict=True):
            common, pieces = self._trees.split(trial, items)
            which = (parts, lead, *_key(trial, common))
            group = groups.setdefault(which, _Group(trial, common, lead, {}))
            asked.append({(*which, *piece.key()): piece for piece in pieces})
            for key, piece in asked[-1].items():
                if key in self._kept:
                    found[key] = self._kept[key]
                else:
                    group.missing.setdefault(piece.columns, {})[key] = piece
        runs = []
        for group in groups.values():
            for row in zip_longest(*(each.items() for each in group.missing.values())):
                held = dict(item for item in row if item)
                run = trees.joined(group.trial, group.common, held.values())
                runs.append((held, group.lead, *run))
        moved = self._moved([(trial, items) for _, _, trial, items in runs], parts)
        for (held, lead, trial, items), motion in zip(runs, moved, strict=True):
            seen = self._samples(trial, items, motion, self.dt / parts, lead)
            for key, piece in held.items():
                self._kept[key] = found[key] = seen[:, piece.columns]
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return [self._put_together(pieces, found) for pieces in asked]

    def _moved(
        self, pairs: Sequence[tuple[Trial, Sequence[Effect]]], parts: float
    ) -> list[np.ndarray]:
        """What sensors without an effect would read of each trial, ``(T, C)``, every
        `FINE`. Effects on readings move nothing: one motion serves all of them.

        Args:
            pairs: trials with their effects.
            parts: into how many a step is cut.
        """
        keys, missing = [], {}
        for trial, effects in pairs:
            physical = [item for item in effects if not _on_readings(item)]
            state = str(trial.conditions.get(start.STATE))
            keys.append((parts, state, *_key(trial, physical)))
            if keys[-1] not in self._motions:
                missing[keys[-1]] = trial, physical
        dt = self.dt / parts
        jobs = [self._job(trial, items, parts) for trial, items in missing.values()]
        motions = self._settled(jobs, self._lead(dt)) if jobs else []
        for (key, (_, items)), motion in zip(missing.items(), motions, strict=True):
            model = self.compiled(items).model
            self._motions[key] = self._view(model).read(model, motion[:: _every(dt)])
        found = [self._motions[key] for key in keys]
        most = READ // max((each.nbytes for each in found), default=1)
        while len(self._motions) > most:
            self._motions.popitem(last=False)
        return found

    def _settled(self, jobs: Sequence[Job], lead: int) -> list[np.ndarray]:
        """States ``(S + 1, n)`` of robots from where they have settled on, which those
        that settle alike do once; NaN where one diverges.

        Args:
            jobs: of one segment each, settling included.
            lead: steps that it takes.
        """
        if not lead:
            return [motion.states for motion in self._pool.map(jobs)]
        rests: dict[tuple, Job] = {}
        keys = []
        for begin, ((compiled, control), *_), *_ in jobs:
            head = control[:lead]
            keys.append((id(compiled), begin.tobytes(), head.tobytes()))
            rests.setdefault(keys[-1], Job(begin, (Segment(compiled, head),)))
        rested = dict(zip(rests, self._pool.map([*rests.values()]), strict=True))
        further, made = [], []
        for key, job in zip(keys, jobs, strict=True):
            rest, (compiled, control) = rested[key], job.segments[0]
            left = Segment(compiled, control[lead:])
            made.append(np.full((len(left.control) + 1, len(job.start)), np.nan))
            if rest.diverged < 0:
                further.append(Job(rest.states[-1], (left,), rest.warm, made[-1]))
        self._pool.map(further)
        return made

    def _put_together(
        self, pieces: Mapping[tuple, trees.Piece], found: Mapping[tuple, np.ndarray]
    ) -> np.ndarray:
        """Samples ``(T, C)`` from those of each tree, by key."""
        made = np.empty((len(found[next(iter(pieces))]), len(self.config.seen)))
        for key, piece in pieces.items():
            made[:, piece.columns] = found[key]
        return made

    def unseen(self, trial: Trial, rows: Sequence[int]) -> list[dict[str, list[float]]]:
        """Joints that nobody observed, as the nominal model moves them: at each of some
        samples their position [rad or m] and speed, and how unsure both are.

        Args:
            trial: recorded trial.
            rows: indices of its samples.
        """
        model = self.model
        names = start.unseen(model, self.config)
        found: list[dict[str, list[float]]] = [{} for _ in rows]
        if not names:
            return found
        (motion,) = self._pool.map([self._job(trial, (), 1)])
        if motion.diverged >= 0:
            return found
        moments = trial.times[list(rows)] - trial.times[trial.boundaries[0]]
        steps = self._lead(self.dt) + np.rint(moments / self.dt).astype(int)
        for name in names:
            joint = model.joint(name)
            at = 1 + joint.qposadr[0], 1 + model.nq + joint.dofadr[0]
            ways = motion.states[:, at]
            if (unsure := start.LIMP * ways.std(axis=0)).all():
                for each, way in zip(found, ways[steps], strict=True):
                    each[name] = [*map(float, way), *map(float, unsure)]
        return found

    def _lead(self, dt: float) -> int:
        return round(self.config.settle / dt)

    def _job(self, trial: Trial, effects: Sequence[Effect], parts: float) -> Job:
        scene = self.compiled(effects, parts)
        rest = self.starts.rest(self.model)[self.actuators]
        dt = self.dt / parts
        before, told = command_steps.arriving(trial, effects, rest, self.config, dt)
        begin = self.starts.state(trial, scene.model)
        if self.config.recorded or start.STATE in trial.conditions:
            begin, first = begin.copy(), 1 + scene.model.nq + scene.model.nv
            held = command_steps.filtered(before, scene.model, self.actuators)
            for at, value in held.items():
                begin[first + at] = value
        ctrl = np.tile(self.starts.rest(scene.model), (len(told), 1))
        ctrl[:, self.actuators] = told
        return Job(begin, (Segment(scene, ctrl),))

    def _samples(
        self,
        trial: Trial,
        effects: Sequence[Effect],
        read: np.ndarray,
        dt: float,
        ahead: float,
    ) -> np.ndarray:
        times = np.arange(len(read)) * _every(dt) * dt
        names = tuple(item.channel.name for item in self.config.seen)
        on, rng = np.ones(len(times), bool), np.random.default_rng(0)
        for effect in effects:
            if isinstance(effect, SensorEffect):
                read = effect.apply(times, read, names, on, rng)
            elif isinstance(effect, TrackingEffect):
                read = read.copy()
                for place, at in self.config.tracked(str(effect["part"])).items():
                    signal = PoseSignal(times, read[:, at], times, read[:, at], place)
                    read[:, at] = effect.apply(signal, on, rng)[1]
        at = trial.times - trial.times[trial.boundaries[0]] + ahead
        return np.stack([np.interp(at, times, column) for column in read.T], axis=1)


def _edit(made: mujoco.MjSpec, effects: Sequence[Effect]) -> None:
    """Write effects on parts into a spec."""
    for effect in effects:
        wanted = effect.stage == "body" and not effect.is_nominal
        if wanted and isinstance(effect, ModelEdit):
            effect.edit(made)


def _every(dt: float) -> int:
    """How many steps lie between kept states."""
    return max(1, int(FINE / dt + 1e-9))


def _on_readings(effect: Effect) -> bool:
    """Whether an effect changes what is read and not how the robot moves."""
    moves = isinstance(effect, CommandEffect | ModelEdit)
    return isinstance(effect, SensorEffect | TrackingEffect) and not moves


def _key(trial: Trial, effects: Sequence[Effect]) -> tuple:
    """What tells simulations apart, but for what each tree needs."""
    told = trial.commands
    return (
        told.values.tobytes(),
        told.durations.tobytes(),
        trial.times.tobytes(),
        trial.observed[:1].tobytes(),
        isinstance(trial.conditions.get(start.STATE), dict),
        tuple(str(effect) for effect in effects),
    )
