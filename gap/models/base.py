"""What the diagnosis needs of a nominal model: `GapModel`.

The diagnosis knows nothing of robots. A model re-executes recorded commands with any of
its numbers changed and says how observations become features: small pieces of relative
motion, each over one window between two samples, so that an early error does not
spoil all that follows.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.gap.decomposition.row import Row
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Channel, Trial

BLOCK = 2.0  # [s] of one long recording that count as one trial
FEW = 4  # trials, below which recordings are cut into blocks


@dataclass(frozen=True, eq=False)
class Windows:
    """Pieces of one trial over which motion is compared, in order of time.

    Attributes:
        first, last: sample at the start and at the end of each, shape ``(W,)``; both
            were seen (not NaN).
        times: middle of each [s], shape ``(W,)``.
        durations: length of each [s], shape ``(W,)``.
    """

    first: np.ndarray
    last: np.ndarray
    times: np.ndarray
    durations: np.ndarray

    def __len__(self) -> int:
        return len(self.first)


class GapModel(ABC):
    """A nominal model all of whose doubtful numbers can be changed at once.

    Attributes:
        name: of the model.
        channels: what is observed, as in `Trial.channels`.
        features: what is compared, C channels (for a planar robot forward [m], left
            [m], turn [rad] over a window).
        process: what a nominal robot scatters by itself in one second of motion, by
            feature, ``(C,)``; for plans.
        resolution: smallest standard deviation of the measurement of each observed
            channel that is believed, ``(n_channels,)``.
        limits: lowest and highest command and its unit, by channel; empty = not known.
        leeway: share of a command's range by which a recording may be told more: much
            where limits are those of plans, not the robot's.
        dt: physics step [s]; 0 = none.
        whole: whether motion is compared since its trial began, not over windows.
        timed: whether commands last as long as they are told.
        logs: whether `read_log` reads logs.
        memory: order of the autoregression that residuals may have; 0 = none.
        many: whether fits are also started from all rows at once: where many depart
            at once a tangent at the nominal misleads.
        starts: explanations that are fitted by themselves, by the tangent at the
            nominal and as many by levels and departures.
        odds: log odds against each explanation, by how many there are: with 3 about one
            of twenty is expected.
        longest: seconds of a recording that are fitted; of a longer one each trial is
            shortened (`bns.gap.recordings.segments`).
        before: seconds after which a simulation begun at rest moves as the robot.
        one_step: whether `paths` has one step alone, and no coarse one beside.
        singly: whether fits are started from single explanations alone: where there
            are more rows than a tangent at the nominal can tell apart.
        spread: plausible departures at which each row is tried by itself, beside its
            levels.
        further: the same, for those alone that say most at these.
    """

    name: str
    channels: tuple[Channel, ...]
    features: tuple[Channel, ...]
    process: np.ndarray
    resolution: np.ndarray
    limits: Mapping[str, tuple[float, float, str]] = {}
    leeway: float = 1e-6
    dt: float = 0.0
    whole: bool = False
    timed: bool = True
    logs: bool = False
    memory: int = 0
    many: bool = False
    longest: float = float("inf")
    before: float = 0.0
    starts: int = 4
    one_step: bool = False
    singly: bool = False
    spread: tuple[float, ...] = ()
    further: tuple[float, ...] = ()
    odds: float = 3.0

    def grid(self, trial: Trial) -> float:
        """Time on whose multiples the commands of a recorded trial are put [s]; 0 =
        none."""
        del trial
        return self.dt

    @property
    @abstractmethod
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of each feature, ``(C,)``."""

    @abstractmethod
    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """All numbers that may be off, in a fixed order; they may depend on what was
        told (a dead band is tried between the speeds told)."""

    def stepped(self, trials: Sequence[Trial], rows: Sequence[Row]) -> tuple[Row, ...]:
        """Rows whose steps for derivatives stand out of what the simulation of these
        trials does by itself.

        Args:
            trials: N recorded trials.
            rows: as `rows` gives them.
        """
        del trials
        return tuple(rows)

    @abstractmethod
    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """What would have been observed, had these effects held.

        The recorded commands are executed again from the observed start of each trial,
        all sets of effects in one batch. Nothing is random.

        Args:
            trials: N recorded trials.
            effects: E sets of effects; the empty set is the nominal model.

        Returns:
            Per set, per trial: ``(T, n_channels)`` at the trial's own samples; NaN
            from where the simulation diverged.
        """

    @abstractmethod
    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """Predicted observations with rows changed.

        Args:
            trials: N recorded trials.
            sets: E sets; of each, by trial, the values of the rows that are not
                nominal.
            fine: at the fine step; False = at the coarse one, which is for differences
                from the first set.

        Returns:
            Per set, per trial ``(T, n_channels)``; NaN from where it diverged.
        """

    @abstractmethod
    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """Features of observations or predictions, ``(..., W, C)``.

        Args:
            trial: recorded trial.
            observed: ``(..., T, n_channels)``, recorded or simulated.
            windows: W windows into the trial, also longer ones.
        """

    @abstractmethod
    def windows(self, trial: Trial) -> Windows:
        """The windows of a trial, one short horizon, tiling it."""

    def joint_windows(self, trial: Trial) -> Windows:
        """Windows over which motion is compared in the fit; they may overlap."""
        return self.windows(trial)

    @abstractmethod
    def effect(self, term: str, values: Mapping[str, float]) -> Effect | None:
        """The effect of an explanation; None for a nuisance.

        Args:
            term: name of the explanation.
            values: of its rows.
        """

    def covered(self, term: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """Values of rows that an explanation covers and that do nearly what it does;
        empty = they are found by their slopes.

        Args:
            term: name of the explanation.
            values: of its rows.
        """
        del term, values
        return {}

    def parse(self, text: str) -> Effect:
        """An effect as a diagnosis with this model writes it."""
        return registry.parse(text)

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """What went on in each window, by name in words, each ``(W,)``.

        For localising in which regime a gap sits: commands, their signs and changes,
        heading, position, time.
        """
        del trial, windows
        return {}

    def patterns(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """What an effect that the library lacks may go with, by name in words: numbers
        of each window, ``(W, K)``. Empty = nothing is known of this."""
        del trial, windows
        return {}

    def begun(self, trial: Trial) -> Mapping[str, float]:
        """Numbers of the state in which a trial began that are not known, each with its
        standard deviation; `paths` takes them by these names. Empty = it is known."""
        del trial
        return {}

    def started(
        self,
        trials: Sequence[Trial],
        known: Sequence[Mapping[str, float]],
        *,
        fine: bool = True,
    ) -> tuple[list[str], list[list[np.ndarray]]]:
        """Predicted observations, and again with each unsure number of the state in
        which trials began off by its standard deviation.

        Args:
            trials: N recorded trials.
            known: by trial the values of the rows that are not nominal.
            fine: see `paths`.

        Returns:
            K names of such numbers; 1 + K sets of paths, the first of them with the
            starts as they are. A trial whose start has no such number stays.
        """
        unsure = [self.begun(trial) for trial in trials]
        names = list(dict.fromkeys(name for row in unsure for name in row))
        off: list[list[dict[str, float]]] = [[{} for _ in unsure]]
        off += [[{n: row[n]} if n in row else {} for row in unsure] for n in names]
        sets = [[{**a, **b} for a, b in zip(known, row, strict=True)] for row in off]
        return names, self.paths(trials, sets, fine=fine)

    def beside(
        self, trials: Sequence[Trial], known: Sequence[Mapping[str, float]]
    ) -> tuple["GapModel", Sequence[Trial]]:
        """The model and the trials beside explanations that were found: what the
        nominal model scatters, or starts that were fitted to its motion, may be
        otherwise beside them. The same ones, where nothing is.

        Args:
            trials: N recorded trials.
            known: by trial the values of the rows that are not nominal.
        """
        del known
        return self, trials

    def motion(self, features: np.ndarray) -> np.ndarray:
        """How fast each feature moved, ``(N, C)``: noise may grow with it."""
        return np.abs(features)

    def travelled(self, features: np.ndarray) -> np.ndarray:
        """What each feature moved, ``(N, C)``: wherever its zero is."""
        return features

    def blocks(self, trials: Sequence[Trial], windows: Sequence[Windows]) -> np.ndarray:
        """Number of the stretch that each window belongs to, ``(N,)``.

        Stretches are what is resampled and left out. A trial is one; where there are
        few trials, each `BLOCK` seconds.
        """
        made, first = [], 0
        for trial, parts in zip(trials, windows, strict=True):
            number = np.zeros(len(parts), dtype=int)
            if len(trials) < FEW:
                number = ((parts.times - trial.times[0]) / BLOCK).astype(int)
            made.append(first + number)
            first += int(number.max(initial=0)) + 1
        return np.concatenate(made)

    def read_log(self, path: str, columns: str = "") -> list[Trial]:
        """Trials of a log as the model describes it, where `logs` says that it does.

        Args:
            path: of the log.
            columns: TOML file that maps its columns to channels; "" = the model's own
                names.

        Raises:
            BnsError: it does not.
        """
        raise BnsError(f"{path}: model {self.name!r} describes no logs.")

    def excitations(
        self, *, seed: int = 0, told: Mapping[str, float] | None = None
    ) -> tuple[Any, ...]:
        """Commands for plans (`gap/planning/excitation.py`); empty = by its limits.

        Args:
            seed: of random ones.
            told: settings of the robot that all recordings share.
        """
        del seed, told
        return ()

    def at_rest(self, trial: Trial, predicted: np.ndarray) -> frozenset[str]:
        """Observed channels that stand still because of what they measure does.

        Args:
            trial: recorded trial.
            predicted: by the nominal model, ``(T, n_channels)``.
        """
        del trial, predicted
        return frozenset()

    def untried(self) -> tuple[str, ...]:
        """Effects that act on such a robot and are not among its rows, by name."""
        return ()

    def unlisted(self) -> "GapModel | None":
        """The same model with all effects that are usual of such a robot, where its
        description lists some; None if it lists none, or nothing is missing."""
        return None
