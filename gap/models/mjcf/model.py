"""Any MJCF model, with a TOML file that maps its channels, as a nominal model."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from bns.gap.candidates import mjcf, mjcf_ends, mjcf_rows, mjcf_usual
from bns.gap.candidates.mjcf_terms import Terms
from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel, Windows
from bns.gap.models.mjcf import cuts, log, roughness, start
from bns.gap.models.mjcf import effects as own_effects
from bns.gap.models.mjcf.config import FLOOR, OwnConfig
from bns.gap.models.mjcf.simulation import Simulation
from bns.gap.recordings import segments, trial_conditions
from bns.storage import files
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

LEAST = 0.3  # of the noise that is told: the smallest that is believed
FEW = 2  # trials on which longer steps of time are compared with the model's
STRIDE = 0.5  # [s] over which those of a free body are compared


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
    spread = (1.0,)
    further = (0.3, 4.0)
    whole = True
    logs = True
    leeway = 1.0  # `bns gap describe` has limits from what one log was told

    def __init__(self, config: OwnConfig, *, threads: int = 2):
        self.name = config.name
        self.channels = tuple(item.channel for item in config.seen)
        self.features = self.channels
        self.process = np.array([item.scatter for item in config.seen])
        self.resolution = np.array([item.noise for item in config.seen])
        self.limits = {
            item.channel.name: (item.low, item.high, item.channel.unit)
            for item in config.told
        }
        self._given = config, threads
        self.physics = Simulation(config, threads=threads)
        self.config = config = self.physics.config
        model, self.dt = self.physics.model, self.physics.dt
        self._parts = self.physics.finest
        self._pace = roughness.Pace()
        self._touches = False
        self.listed = mjcf.candidates(config, model)
        self._terms = Terms(self.listed, config, model)
        free = start.free(self.physics.model)
        over = config.over_floor.items()
        self._carried = [columns for (_, part), columns in over if part in free]
        carried = {column for part in self._carried for column in part.values()}
        self._turning = [
            column
            for column, item in enumerate(config.seen)
            if item.turning and column not in carried
        ]

    @classmethod
    def read(cls, path: str | Path, *, threads: int = 2) -> "OwnModel":
        """The model that a TOML file describes."""
        return cls(OwnConfig.read(path), threads=threads)

    @staticmethod
    def parse(text: str) -> Effect:
        """An effect on this model, as a diagnosis writes it."""
        return own_effects.parse(text)

    def read_log(self, path: str, columns: str = "") -> list[Trial]:
        """Trials of a log, none longer than the model foresees."""
        config = self.config.mapped(columns) if columns else self.config
        trials = start.held(log.read(path, config), config, self.physics.starts.stood)
        log.possible(trials, config, self.physics.model)
        return cuts.foreseen(trials, self.config, self.physics, self)

    def beside(
        self, trials: Sequence[Trial], known: Sequence[Mapping[str, float]]
    ) -> tuple[GapModel, Sequence[Trial]]:
        """See `GapModel.beside`: starts that were fitted to the nominal motion."""
        return self, cuts.restarted(trials, self.config, self, known)

    def grid(self, trial: Trial) -> float:
        """See `GapModel.grid`: none, commands may end between steps."""
        return 0.0

    @property
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of each feature."""
        return LEAST * self.resolution

    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """All numbers that may be off, those of all joints alike included.

        From then on fine paths are simulated as finely as these trials need.
        """
        self._parts = self.physics.needed(trials)
        loads = self.physics.loads(trials)
        self.physics.apart(loads)
        self._touches = bool(loads.touching)
        return self._terms.rows(
            trials,
            self.dt,
            loads,
            mjcf_ends.sooner(self.config.seen, trials, loads.travel),
            stepped=self._parts > 1 or self._touches,
        )

    def stepped(self, trials: Sequence[Trial], rows: Sequence[Row]) -> tuple[Row, ...]:
        """See `GapModel.stepped`: a simulation is rough where something touches.

        From then on coarse paths have the longest step of time by which nearly all rows
        change the same; the model's own is for those that change otherwise.
        """
        few, rough = trials[:: max(len(trials) // FEW, 1)][:FEW], 0.0
        if self._touches:
            some = few if len(rows) > roughness.MOST else self.physics.some(trials)
            changed = partial(self._changed, some, 1)
            rough = roughness.level(rows, changed)
            rows = roughness.stepped(rows, changed, rough)
        self._pace, paces = roughness.Pace(), self.physics.paces
        if paces:
            self._pace = roughness.of_pace(
                rows,
                paces,
                lambda pace: partial(self._changed, few, pace),
                rough,
                self._off(few),
            )
        return tuple(rows)

    def _off(self, trials: Sequence[Trial]) -> float:
        """Root mean square of what was recorded over the nominal motion, in units of
        the noise."""
        (paths,) = self._paths(trials, [[{}] * len(trials)], 1)
        seen, made = self._compared(trials, [[t.observed for t in trials], paths])
        return float(np.sqrt(np.nanmean((seen - made) ** 2)))

    def _changed(
        self,
        trials: Sequence[Trial],
        parts: float,
        sets: Sequence[Mapping[str, float]],
    ) -> np.ndarray:
        """What values of rows change of the nominal motion, see `roughness.Changed`;
        each step of the model cut into so many parts."""
        whole = [[values] * len(trials) for values in ({}, *sets)]
        base, *others = self._compared(trials, self._paths(trials, whole, parts))
        return np.stack(others) - base

    def _compared(
        self, trials: Sequence[Trial], paths: Sequence[Sequence[np.ndarray]]
    ) -> np.ndarray:
        """Features of sets of paths, in units of the noise, ``(E, N, C)``."""
        seen = [
            self.compare(trial, np.stack(mine), self.windows(trial))
            for trial, mine in zip(trials, zip(*paths, strict=True), strict=True)
        ]
        made: np.ndarray = np.concatenate(seen, axis=1) / self.resolution
        return made

    def untried(self) -> tuple[str, ...]:
        """See `GapModel.untried`."""
        tried = self._terms.tried
        return tuple(name for name in sorted(own_effects.CLASSES) if name not in tried)

    def unlisted(self) -> "OwnModel | None":
        """See `GapModel.unlisted`: for what explains much by itself."""
        wider = mjcf_usual.beside(self.config, self.physics.model)
        if wider == self.config.effects:
            return None
        given, threads = self._given
        made = OwnModel(replace(given, effects=wider), threads=threads)
        made.singly = True
        return made

    def effect(self, term: str, values: Mapping[str, float]) -> Effect | None:
        """See `GapModel.effect`; None for the shift in time and the step."""
        return self._terms.effect(term, values)

    def covered(self, term: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """See `GapModel.covered`: a load that has no mass shifts its body's centre."""
        return self._terms.covered(term, values)

    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """See `GapModel.paths`; the coarse step is that of the model or longer, see
        `stepped`. What finer steps change is that of the nominal motion."""
        if fine:
            return self._paths(trials, sets, self._parts)
        return self._pace.paths(sets, partial(self._paths, trials))

    def _paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        parts: float,
    ) -> list[list[np.ndarray]]:
        """See `paths`; each step of the model cut into so many parts."""
        pairs, leads, shares = [], [], []
        for row in sets:
            for trial, values in zip(trials, row, strict=True):
                off = {n: v for n, v in values.items() if n.startswith(start.NUMBERS)}
                begun = start.moved(trial, off, self.config) if off else trial
                pairs.append((begun, self._terms.changes(values)))
                leads.append(values.get(mjcf_rows.LEAD, 0.0))
                shares.append(values.get(mjcf_rows.STEP, 1.0) - 1.0)
        moved = self.physics.predicted(pairs, parts, leads)
        if any(shares):
            changes = [*self._by_steps(trials)] * len(sets)
            moved = [
                path + share * change
                for path, share, change in zip(moved, shares, changes, strict=True)
            ]
        count = len(trials)
        return [moved[at * count : (at + 1) * count] for at in range(len(sets))]

    def _by_steps(self, trials: Sequence[Trial]) -> Iterator[np.ndarray]:
        """What finer steps change of the nominal motion of each trial, ``(T, C)``."""
        pairs: list[tuple[Trial, tuple[Effect, ...]]] = [
            (trial, ()) for trial in trials
        ]
        fine = self.physics.predicted(pairs, max(self._parts, 2))
        for one, other in zip(fine, self.physics.predicted(pairs), strict=True):
            yield np.nan_to_num(one - other)

    def begun(self, trial: Trial) -> Mapping[str, float]:
        """See `GapModel.begun`: joints that began where they were recorded, or hung."""
        return start.unsure(trial, self.config, self.physics.starts.hung(trial))

    def joint_windows(self, trial: Trial) -> Windows:
        """Windows between samples that were seen."""
        return self.windows(trial)

    def motion(self, features: np.ndarray) -> np.ndarray:
        """Change of each feature from window to window."""
        return np.abs(np.gradient(np.nan_to_num(features), axis=0))

    def travelled(self, features: np.ndarray) -> np.ndarray:
        """See `GapModel.travelled`: a joint that hangs still moves nothing."""
        count = np.isfinite(features).sum(axis=0)
        mean = np.nan_to_num(features).sum(axis=0) / np.maximum(count, 1)
        moved: np.ndarray = features - mean
        return moved

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: predicted samples, each ``(T, n_channels)``."""
        numbers = trial_conditions.numbers(trials)
        pairs = [
            (trial, [item.in_trial(number) for item in items])
            for items in effects
            for trial, number in zip(trials, numbers, strict=True)
        ]
        made = self.physics.predicted(pairs, self._parts)
        count = len(trials)
        return [made[at * count : (at + 1) * count] for at in range(len(effects))]

    def windows(self, trial: Trial) -> Windows:
        """Windows between samples that were seen."""
        return segments.windows(trial, self.config.window)

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """See `GapModel.compare`: what is observed at the end of each window; of what
        a free body carries, how far it came over the floor, and turned, in the last
        `STRIDE`: forwards and to the left of how it stood, if that is observed. Where
        it began is not the robot's, and what it slipped long ago is no error anew."""
        made = observed[..., windows.last, :]
        seen = np.flatnonzero(np.isfinite(trial.observed).all(axis=1))
        if self._turning:  # whole turns are none
            apart = observed[..., seen[:1], :] - trial.observed[seen[:1]]
            whole = 2 * np.pi * np.round(apart / (2 * np.pi))
            made[..., self._turning] -= whole[..., self._turning]
        if self._carried:
            begin = trial.times[windows.last] - STRIDE
            at = np.searchsorted(trial.times[seen], begin, side="right") - 1
            before = observed[..., seen[np.maximum(at, 0)], :]
        for part in self._carried:
            columns = [*part.values()]
            made[..., columns] -= before[..., columns]
            if len(part) == len(FLOOR):
                x, y, yaw = (part[axis] for axis in FLOOR)
                way = made[..., x] + 1j * made[..., y]
                way = way * np.exp(-1j * before[..., yaw])
                made[..., x], made[..., y] = way.real, way.imag
        return made

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

        A body that a stand held is free there again.

        Raises:
            BnsError: the file can not be written.
        """
        made = [self.parse(text) for text in effects]
        spec = self.physics.spec(made, held=False)
        spec.compile()
        files.write_text(path, spec.to_xml())
        return [str(effect) for effect in made if effect.stage != "body"]
