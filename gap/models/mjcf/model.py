"""Any MJCF model, with a TOML file that maps its channels, as a nominal model."""

import math
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from bns.errors import FormatError, UnknownNameError
from bns.gap.candidates import mjcf, mjcf_rows
from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel, Windows
from bns.gap.models.mjcf import cuts, horizon, lean, log, masses, prepared, start, view
from bns.gap.models.mjcf import effects as own_effects
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.recordings import segments
from bns.models import mjcf as mjcf_file
from bns.storage import files
from bns.worlds.effects.base import (
    CommandEffect,
    ControlSignal,
    Effect,
    ModelEdit,
    SensorEffect,
)
from bns.worlds.physics.rollout import STATE, Compiled, Job, Pool, Segment
from bns.worlds.trial import Trial

LEAD = 1.0  # [s] of rest before a trial, so that what is late has something before it
KEPT, MODELS = 20_000, 2000  # simulated trials and compiled models kept in memory
FINE = 0.005  # [s] between kept states; the step if that is longer
FINEST = 0.0025  # [s] steps beyond which a simulation lags or limits soften visibly
EXACT = 0.2  # of the noise: predictions that differ by less are alike
TRIED = 4  # trials on which steps are compared
LEAST = 0.3  # of the noise that is told: the smallest that is believed


class OwnModel(GapModel):
    """A model of the user's own; see `gap/models/base.py` for the attributes.

    Several numbers of such a robot are off at once, so fits are also started from all
    of them; residuals of joints are random walks, so an autoregression is tried.

    Args:
        config: the description.
        threads: of the physics.

    Raises:
        FormatError: the MJCF file is missing or MuJoCo refuses it.
        BnsError: a part that the model lacks.
    """

    memory = 2
    many = True
    whole = True
    logs = True

    def __init__(self, config: OwnConfig, *, threads: int = 2):
        self.config, self.name = config, config.name
        self.channels = tuple(item.channel for item in config.seen)
        self.features = self.channels
        self.process = np.array([item.scatter for item in config.seen])
        self.resolution = np.array([item.noise for item in config.seen])
        self.limits = {
            item.channel.name: (item.low, item.high, item.channel.unit)
            for item in config.told
        }
        self._pool = Pool(threads)
        self._compiled: OrderedDict[tuple, Compiled] = OrderedDict()
        self._cache: OrderedDict[tuple, np.ndarray] = OrderedDict()
        self._starts: dict[tuple, np.ndarray] = {}
        model = self.compiled(()).model
        self.dt = float(model.opt.timestep)
        self._parts = self._finest
        self.actuators = [_index(model, "actuator", t.actuator) for t in config.told]
        if config.keyframe:
            _index(model, "key", config.keyframe)  # there, before anything runs
        self.view = view.View.of(config, model)
        self.listed = mjcf.candidates(config, model)
        self._bodies = {
            item.fixed["part"]: masses.Body.of(model, item.fixed["part"])
            for item in self.listed
            if item.effect == "body_mass"
        }
        self._terms = {
            item.name: item for item in (*self.listed, *mjcf_rows.grouped(self.listed))
        }

    @classmethod
    def read(cls, path: str | Path, *, threads: int = 2) -> "OwnModel":
        """The model that a TOML file describes."""
        return cls(OwnConfig.read(path), threads=threads)

    @staticmethod
    def parse(text: str) -> Effect:
        """An effect on this model, as a diagnosis writes it."""
        return own_effects.parse(text)

    def read_log(self, path: str) -> list[Trial]:
        """Trials of a log, none longer than the model foresees."""
        trials = log.read(path, self.config)
        if self.config.cut:
            return cuts.refined(trials, self.config, self._nominal)
        model = self.compiled(()).model
        return horizon.foreseen(trials, self.config, model, self._nominal)

    def _nominal(self, trials: Sequence[Trial]) -> list[np.ndarray]:
        """Nominal samples of trials."""
        return self.simulate(trials, [()])[0]

    def spec(self, effects: Sequence[Effect]) -> mujoco.MjSpec:
        """The model with the effects on its parts written into it.

        Raises:
            FormatError: the MJCF file is missing or MuJoCo refuses it.
        """
        if not self.config.model.exists():
            raise FormatError(f"There is no model file {self.config.model}.")
        made = prepared.spec(self.config)
        mjcf_file.compiled(made.copy(), self.config.model)
        _edit(made, effects)
        return made

    @cached_property
    def _lean(self) -> mujoco.MjSpec:
        """The model without what only draws it."""
        return lean.lean(self.spec(()))

    def compiled(self, effects: Sequence[Effect], parts: int = 1) -> Compiled:
        """The compiled model with the effects on its parts.

        Args:
            effects: of any stage.
            parts: into how many its step is cut.
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
        return self._compiled[key]

    @property
    def _finest(self) -> int:
        """Into how many parts the step is cut where a simulation has to be fine."""
        return math.ceil(self.dt / FINEST - 1e-9)

    def _needed(self, trials: Sequence[Trial]) -> int:
        """Into how many parts it has to be cut for the nominal motion of trials."""
        few = [(trial, ()) for trial in trials[:: max(len(trials) // TRIED, 1)]]
        exact = self._predicted(few, self._finest)
        parts = 1
        while parts < self._finest:
            made = self._predicted(few, parts)
            apart = [np.abs(a - b) for a, b in zip(made, exact, strict=True)]
            if (np.concatenate(apart) < EXACT * self.resolution).all():
                break
            parts *= 2
        return min(parts, self._finest)

    @property
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of each feature."""
        return LEAST * self.resolution

    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """All numbers that may be off, those of all joints alike included.

        From then on fine paths are simulated as finely as these trials need.
        """
        self._parts = self._needed(trials)
        items = tuple(self._terms.values())
        return mjcf_rows.rows(items, trials, self.dt, self._bodies)

    def effect(self, term: str, values: Mapping[str, float]) -> Effect | None:
        """The effect of an explanation; None for the shift in time."""
        if term == mjcf_rows.LEAD:
            return None
        item = self._terms[term]
        if item.effect == "body_mass":
            part = item.fixed["part"]
            return masses.added(term, values, part, self._bodies[part])
        return item.make(values[term])

    def _changes(self, values: Mapping[str, float]) -> tuple[Effect, ...]:
        """The effects that rows which are not nominal are simulated by."""
        made: list[Effect] = []
        loads: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            item = self._terms.get(mjcf_rows.term(name))
            if item and item.effect == "body_mass":
                loads.setdefault(item.name, {})[name] = value
            elif item:
                made.append(item.make(value))
        for name, rows in loads.items():
            part = self._terms[name].fixed["part"]
            made += masses.changes(name, rows, part, self._bodies[part])
        return tuple(made)

    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """See `GapModel.paths`; the coarse step is that of the model."""
        pairs, leads = [], []
        for row in sets:
            for trial, values in zip(trials, row, strict=True):
                off = {n: v for n, v in values.items() if n.startswith(start.NUMBERS)}
                begun = start.moved(trial, off, self.config) if off else trial
                pairs.append((begun, self._changes(values)))
                leads.append(values.get(mjcf_rows.LEAD, 0.0))
        seen = self._predicted(pairs, self._parts if fine else 1)
        moved = [
            _led(trial, path, lead)
            for (trial, _), path, lead in zip(pairs, seen, leads, strict=True)
        ]
        count = len(trials)
        return [moved[at * count : (at + 1) * count] for at in range(len(sets))]

    def begun(self, trial: Trial) -> Mapping[str, float]:
        """See `GapModel.begun`: joints that began where they were recorded."""
        return start.unsure(trial, self.config)

    def joint_windows(self, trial: Trial) -> Windows:
        """Windows between samples that were seen."""
        return self.windows(trial)

    def motion(self, features: np.ndarray) -> np.ndarray:
        """Change of each feature from window to window."""
        return np.abs(np.gradient(np.nan_to_num(features), axis=0))

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: predicted samples, each ``(T, n_channels)``."""
        pairs = [(trial, items) for items in effects for trial in trials]
        made = self._predicted(pairs, self._parts)
        count = len(trials)
        return [made[at * count : (at + 1) * count] for at in range(len(effects))]

    def _predicted(
        self, pairs: Sequence[tuple[Trial, Sequence[Effect]]], parts: int = 1
    ) -> list[np.ndarray]:
        """Predicted samples of trials, each under effects of its own."""
        keys = [(parts, *_key(trial, items)) for trial, items in pairs]
        wanted = {
            key: pair
            for key, pair in zip(keys, pairs, strict=True)
            if key not in self._cache
        }
        jobs = [self._job(trial, items, parts) for trial, items in wanted.values()]
        motions = self._pool.map(jobs) if jobs else []
        fresh = {}
        for (key, (trial, items)), motion in zip(wanted.items(), motions, strict=True):
            states = motion.states[self._lead(self.dt / parts) :]
            fresh[key] = self._samples(trial, items, states, self.dt / parts)
        made = [fresh[key] if key in fresh else self._cache[key] for key in keys]
        self._cache.update(fresh)
        while len(self._cache) > KEPT:
            self._cache.popitem(last=False)
        return made

    def _lead(self, dt: float) -> int:
        return round(self.config.settle / dt)

    def _job(self, trial: Trial, effects: Sequence[Effect], parts: int) -> Job:
        scene = self.compiled(effects, parts)
        told = self._told(trial, effects, self.dt / parts)
        begin = self._start(trial)
        ctrl = np.tile(self._rest(scene.model), (len(told), 1))
        ctrl[:, self.actuators] = told
        return Job(begin, (Segment(scene, ctrl),))

    def _rest(self, model: mujoco.MjModel) -> np.ndarray:
        if self.config.keyframe:
            key = _index(model, "key", self.config.keyframe)
            return np.array(model.key_ctrl[key])
        return np.zeros(model.nu)

    def _told(self, trial: Trial, effects: Sequence[Effect], dt: float) -> np.ndarray:
        """Commands at each physics step after the effects, settling included."""
        ends = np.rint(np.cumsum(trial.commands.durations) / dt).astype(int)
        counts = np.diff(ends, prepend=0)  # steps add up to the whole trial
        lead, extra = self._lead(dt), round(LEAD / dt)
        rest = self._rest(self.compiled(()).model)[self.actuators]
        values = np.repeat(trial.commands.values, counts, axis=0)
        before = start.before(trial, rest, lead + extra, self.config, dt)
        values = np.concatenate([before, values])
        signal = ControlSignal(
            times=np.arange(len(values)) * dt,
            values=values,
            command=np.repeat(np.arange(-1, len(counts)), [len(before), *counts]),
            channels=tuple(item.channel.name for item in self.config.told),
            dt=dt,
        )
        on, rng = np.ones(len(values), bool), np.random.default_rng(0)
        for effect in effects:
            if isinstance(effect, CommandEffect) and effect.stage == "command":
                made = effect.apply(signal, on, rng)
                signal = ControlSignal(
                    signal.times, made, signal.command, signal.channels, dt
                )
        return signal.values[extra:]

    def _start(self, trial: Trial) -> np.ndarray:
        """The state that a trial begins in, kept: effects do not change it."""
        key = (trial.observed[:1].tobytes(), str(trial.conditions.get(start.STATE)))
        if key not in self._starts:
            self._starts[key] = self._begun_in(trial)
        return self._starts[key]

    def _begun_in(self, trial: Trial) -> np.ndarray:
        model = self.compiled(()).model
        data = mujoco.MjData(model)
        if self.config.keyframe:
            key = _index(model, "key", self.config.keyframe)
            mujoco.mj_resetDataKeyframe(model, data, key)
        if self.config.recorded or start.STATE in trial.conditions:
            start.place(data, trial, self.view)
        state = np.empty(mujoco.mj_stateSize(model, STATE))
        data.time = 0.0
        mujoco.mj_getState(model, data, state, STATE)
        return state

    def _samples(
        self,
        trial: Trial,
        effects: Sequence[Effect],
        states: np.ndarray,
        dt: float,
    ) -> np.ndarray:
        every = max(1, int(FINE / dt + 1e-9))
        grid = np.arange(0, len(states), every)
        times = grid * dt
        scene = self.compiled(effects)
        read = self.view.read(scene.model, states[grid])
        names = tuple(channel.name for channel in self.channels)
        on, rng = np.ones(len(times), bool), np.random.default_rng(0)
        for effect in effects:
            if isinstance(effect, SensorEffect):
                read = effect.apply(times, read, names, on, rng)
        at = trial.times - trial.times[trial.boundaries[0]]
        return np.stack([np.interp(at, times, column) for column in read.T], axis=1)

    def windows(self, trial: Trial) -> Windows:
        """Windows between samples that were seen."""
        return segments.windows(trial, self.config.window)

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """See `GapModel.compare`: what is observed at the end of each window."""
        return observed[..., windows.last, :]

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """Commands, their changes, time, and the predicted readings and their speed,
        each ``(W,)``.

        Predicted and not recorded ones: the noise of these is part of what is tested.
        """
        ((expected,),) = self.simulate([trial], [()])
        index, since, at = segments.told(trial, windows)
        told = trial.commands.values
        before = np.vstack([told[:1], told[:-1]])[index]
        made = {}
        for column, item in enumerate(self.config.told):
            name = item.channel.name
            made[f"command {name}"] = told[index, column]
            made[f"change of command {name}"] = told[index, column] - before[:, column]
        for column, channel in enumerate(self.channels):
            seen = np.nan_to_num(expected[:, column])
            made[channel.name] = seen[windows.first]
            step = seen[windows.last] - seen[windows.first]
            made[f"speed of {channel.name}"] = step / windows.durations
        made["time since the command changed"] = since
        made["time in the trial"] = at
        return made

    def write_corrected(self, effects: Sequence[str], path: str | Path) -> list[str]:
        """Write the MJCF with the effects on its parts; gives those it can not hold.

        Raises:
            BnsError: the file can not be written.
        """
        made = [self.parse(text) for text in effects]
        spec = self.spec(made)
        spec.compile()
        files.write_text(path, spec.to_xml())
        return [str(effect) for effect in made if effect.stage != "body"]


def _edit(made: mujoco.MjSpec, effects: Sequence[Effect]) -> None:
    """Write effects on parts into a spec."""
    for effect in effects:
        wanted = effect.stage == "body" and not effect.is_nominal
        if wanted and isinstance(effect, ModelEdit):
            effect.edit(made)


def _led(trial: Trial, path: np.ndarray, lead: float) -> np.ndarray:
    """A path so many seconds ahead of itself."""
    if lead == 0.0:
        return path
    at = trial.times - trial.times[trial.boundaries[0]]
    return np.stack([np.interp(at + lead, at, column) for column in path.T], axis=1)


def _key(trial: Trial, effects: Sequence[Effect]) -> tuple:
    told = trial.commands
    return (
        told.values.tobytes(),
        told.durations.tobytes(),
        trial.times.tobytes(),
        trial.observed[:1].tobytes(),
        str(trial.conditions.get(start.STATE)),
        tuple(str(effect) for effect in effects),
    )


def _index(model: mujoco.MjModel, kind: str, name: str) -> int:
    try:
        return int(getattr(model, kind)(name).id)
    except KeyError:
        count = {"actuator": model.nu, "key": model.nkey}[kind]
        known = [getattr(model, kind)(number).name for number in range(count)]
        raise UnknownNameError(f"{kind} of the model", name, known) from None
