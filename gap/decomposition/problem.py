"""A recording and a model made ready for the fit: `Problem`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bns.gap.decomposition import untold
from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel, Windows
from bns.gap.recordings import segments, trial_conditions
from bns.worlds.trial import Trial

FAR = 1e3  # residual of a diverged simulation
SAMPLE = 12.0  # [s] of recording that a first look takes


@dataclass(frozen=True, eq=False)
class Problem:
    """What every stage of the fit works on. N windows of all trials, C features.

    Attributes:
        model: nominal model.
        trials: checked recording.
        rows: R numbers that may be off.
        windows: of each trial.
        recorded: features, ``(N, C)``; NaN = not seen.
        trial: number of the trial of each window, ``(N,)``.
        block: number of its stretch, ``(N,)``, see `GapModel.blocks`.
        numbers: number of each trial in the recording.
    """

    model: GapModel
    trials: tuple[Trial, ...]
    rows: tuple[Row, ...]
    windows: tuple[Windows, ...]
    recorded: np.ndarray
    trial: np.ndarray
    block: np.ndarray
    numbers: tuple[int, ...]
    onset: Mapping[str, int] = field(default_factory=dict)
    """first trial of the rows that set in later, by name"""
    silent: frozenset[str] = frozenset()
    """names of rows that change nothing here, whose derivatives are 0"""
    dated: bool = False
    """whether commands are taken to have begun where the log tells them"""

    @classmethod
    def of(cls, trials: Sequence[Trial], model: GapModel) -> "Problem":
        """Features of a checked recording, and the model's rows."""
        kept = segments.shortened(trials, model.longest, model.before)
        trials = [trial for trial, _ in kept]
        windows = tuple(model.joint_windows(trial) for trial in trials)
        seen = [
            model.compare(trial, trial.observed[:, : len(model.channels)], parts)
            for trial, parts in zip(trials, windows, strict=True)
        ]
        for features, parts, (trial, begun) in zip(seen, windows, kept, strict=True):
            features[parts.times - trial.times[0] < begun] = np.nan
        counts = [len(parts) for parts in windows]
        return cls(
            model,
            tuple(trials),
            model.stepped(trials, model.rows(trials)),
            windows,
            np.concatenate(seen),
            np.repeat(np.arange(len(trials)), counts),
            model.blocks(trials, windows),
            tuple(trial_conditions.numbers(trials)),
        )

    @cached_property
    def nominal(self) -> np.ndarray:
        """Nominal values, ``(R,)``."""
        return np.array([row.nominal for row in self.rows])

    @cached_property
    def sd(self) -> np.ndarray:
        """Plausible departures, ``(R,)``."""
        return np.array([row.sd for row in self.rows])

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest values, ``(R,)`` each."""
        low = np.array([row.low for row in self.rows])
        return low, np.array([row.high for row in self.rows])

    @cached_property
    def terms(self) -> dict[str, tuple[int, ...]]:
        """Numbers of the rows of each explanation, nuisances included."""
        made: dict[str, tuple[int, ...]] = {}
        for number, row in enumerate(self.rows):
            made[row.term] = (*made.get(row.term, ()), number)
        return made

    @cached_property
    def joins(self) -> dict[int, tuple[int, ...]]:
        """By number of a row that is several others alike, the numbers of these."""
        at = {row.name: number for number, row in enumerate(self.rows)}
        return {
            number: tuple(at[name] for name in row.joins)
            for number, row in enumerate(self.rows)
            if row.joins and at.keys() >= set(row.joins)
        }

    @cached_property
    def seen(self) -> np.ndarray:
        """Which features were seen, ``(N, C)``."""
        return np.isfinite(self.recorded)

    def predict(
        self,
        values: Sequence[np.ndarray],
        *,
        fine: bool = True,
        only: Sequence[int] | None = None,
    ) -> np.ndarray:
        """Predicted features, ``(E, N, C)``; NaN where a simulation diverged.

        Args:
            values: E sets of values of all rows, ``(R,)`` each.
            fine: at the fine step.
            only: numbers of the trials that are simulated, None = all; features of the
                others are 0.
        """
        chosen = range(len(self.trials)) if only is None else only
        trials = [self.trials[n] for n in chosen]
        sets = [[self.changed(value, n) for n in chosen] for value in values]
        made = self.model.paths(trials, sets, fine=fine)
        count = len(self.channels)
        out = np.zeros((len(values), len(self.trial), count))
        inside = np.isin(self.trial, list(chosen))
        for row, paths in zip(out, made, strict=True):
            row[inside] = np.concatenate(
                [
                    self.model.compare(self.trials[n], path, self.windows[n])
                    for n, path in zip(chosen, paths, strict=True)
                ]
            )
        return out

    @property
    def channels(self) -> tuple:
        """What is compared."""
        return self.model.features

    def changed(self, values: np.ndarray, trial: int) -> dict[str, float]:
        """Rows of values ``(R,)`` that are not nominal in a trial, by name; what grows
        with the number of the trial comes as what it has grown to."""
        number = self.numbers[trial]
        return {
            row.name: float(value) * (number if row.per_trial else 1)
            for row, value in zip(self.rows, values, strict=True)
            if value != row.nominal and number >= self.onset.get(row.name, 0)
        }

    def known(self, values: np.ndarray) -> list[dict[str, float]]:
        """Rows of values ``(R,)`` that are not nominal, by trial, see `changed`."""
        return [self.changed(values, number) for number in range(len(self.trials))]

    def residual(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Recorded minus predicted features, and the predicted ones, ``(N, C)``.

        A diverged simulation leaves `FAR`; what was not seen stays NaN.
        """
        (made,) = self.predict([values])
        lost = ~np.isfinite(made)
        made = np.where(lost, 0.0, made)
        rest = np.where(self.seen & lost, FAR, self.recorded - made)
        return rest, made

    def begun(self, values: np.ndarray) -> np.ndarray:
        """What a standard deviation of each number of the state in which a trial began
        changes of the features of that trial, ``(K, N, C)``.

        Args:
            values: of all rows, ``(R,)``.
        """
        if not any(map(self.model.begun, self.trials)):
            return np.zeros((0, *self.recorded.shape))
        known = self.known(values)
        _, made = self.model.started(self.trials, known, fine=False)
        base, *moved = (self.features(paths) for paths in made)
        return np.nan_to_num(np.stack(moved) - base)

    @cached_property
    def open_commands(self) -> list[np.ndarray]:
        """What a standard deviation of when each command began changes of the features
        of its trial by the nominal model, where a log tells it to a sample only, and of
        what was told in rows that it lost: by trial ``(K, n, C)``."""
        dt = self.model.dt
        other = [
            [*([] if self.dated else untold.sooner(t, dt)), *untold.lost(t)]
            for t in self.trials
        ]
        trials = [*self.trials, *(item.trial for row in other for item in row)]
        made = []
        if len(trials) > len(self.trials):
            (paths,) = self.model.paths(trials, [[{}] * len(trials)], fine=False)
            bases, moved = paths[: len(other)], iter(paths[len(other) :])
        for number, row in enumerate(other):
            trial, windows = self.trials[number], self.windows[number]
            found = [np.zeros((0, len(windows), len(self.channels)))]
            for item in row:
                pair = np.stack([bases[number], next(moved)])
                base, path = self.model.compare(trial, pair, windows)
                found.append(item.directions(path - base, windows))
            made.append(np.concatenate(found))
        return made

    @property
    def any_open(self) -> bool:
        """Whether it is left open when some command began, or what it was."""
        return any(map(len, self.open_commands))

    def features(self, paths: Sequence[np.ndarray]) -> np.ndarray:
        """Features ``(N, C)`` of a path of each trial."""
        parts = zip(self.trials, paths, self.windows, strict=True)
        return np.concatenate([self.model.compare(*part) for part in parts])

    def without(self, left_out: np.ndarray) -> "Problem":
        """The same, some windows ``(N,)`` taken as not seen."""
        recorded = np.where(left_out[:, None], np.nan, self.recorded)
        return replace(self, recorded=recorded)

    def some(self, numbers: Sequence[int]) -> "Problem":
        """The same of some trials alone.

        Args:
            numbers: of the trials, in ascending order.
        """
        inside = np.isin(self.trial, numbers)
        return replace(
            self,
            trials=tuple(self.trials[n] for n in numbers),
            windows=tuple(self.windows[n] for n in numbers),
            recorded=self.recorded[inside],
            trial=np.searchsorted(numbers, self.trial[inside]),
            block=np.unique(self.block[inside], return_inverse=True)[1],
            numbers=tuple(self.numbers[n] for n in numbers),
        )

    @cached_property
    def gap(self) -> np.ndarray:
        """Residuals of the nominal model, ``(N, C)``."""
        return self.residual(self.nominal)[0]

    def slopes(
        self,
        values: np.ndarray,
        which: Sequence[int],
        *,
        only: Sequence[int] | None = None,
    ) -> dict[int, np.ndarray]:
        """Derivatives of the features by some rows, ``(N, C)`` each.

        One whose simulation diverges is 0.

        Args:
            values: of all rows, ``(R,)``.
            which: numbers of the rows.
            only: see `predict`.
        """
        sets, steps = [values], []
        silent = [number for number in which if self.rows[number].name in self.silent]
        which = [number for number in which if number not in silent]
        joined = self._joined(which)
        simulated = [number for number in which if number not in joined]
        for number in simulated:
            row = self.rows[number]
            step = row.inward(values[number], row.difference)
            moved = values.copy()
            moved[number] += step
            sets.append(moved)
            steps.append(step)
        base, *made = self.predict(sets, fine=False, only=only)
        found = {
            number: np.nan_to_num((path - base) / step, posinf=0.0, neginf=0.0)
            for number, path, step in zip(simulated, made, steps, strict=True)
        }
        for number, parts in joined.items():
            factor = self.rows[number].nominal == 1.0 and values[number] > 0
            found[number] = np.sum(
                [
                    found[k] * (values[k] / values[number] if factor else 1.0)
                    for k in parts
                ],
                axis=0,
            )
        return found | dict.fromkeys(silent, np.zeros_like(base))

    def _joined(self, which: Sequence[int]) -> dict[int, tuple[int, ...]]:
        """Rows whose derivative is the sum of those of the rows that they join, by the
        chain rule: a gain of both wheels is one of each."""
        chosen = [number for number in which if number in self.joins]
        return {n: self.joins[n] for n in chosen if set(self.joins[n]) <= set(which)}

    def sample(self, seconds: float = SAMPLE) -> list[int]:
        """Numbers of trials that are a first look: spread over the recording, no two of
        the same commands while others are left."""
        count = len(self.trials)
        order = sorted(range(count), key=lambda n: ((7 * n) % count, n))
        told: set[bytes] = set()
        fresh: list[int] = []
        again: list[int] = []
        for number in order:
            key = self.trials[number].commands.values.round(3).tobytes()
            (again if key in told else fresh).append(number)
            told.add(key)
        chosen, total = [], 0.0
        for number in (*fresh, *again):
            chosen.append(number)
            total += self.trials[number].commands.duration
            if total > seconds:
                break
        return sorted(chosen)
