"""What the decomposition needs of a nominal model."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from bns.gap.decomposition.row import Row
from bns.gap.models.base import Windows
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Channel, Trial

BLOCK = 2.0  # [s] of one long recording that count as one trial
FEW = 4  # trials, below which recordings are cut into blocks


class DecomposableModel(ABC):
    """A nominal model all of whose doubtful numbers can be changed at once.

    Attributes:
        name: of the model.
        channels: what is observed, as in `Trial.channels`.
        features: what is compared, C channels.
        least: smallest standard deviation of each feature that is believed, ``(C,)``.
        process: what a nominal robot scatters by itself in one second of motion, by
            feature, ``(C,)``; for plans.
        memory: order of the autoregression that residuals may have; 0 = none.
        many: whether fits are also started from all rows at once: where many depart
            at once a tangent at the nominal misleads.
        longest: seconds of a recording that are fitted; of a longer one each trial is
            shortened (`bns.gap.recordings.stretches`).
        before: seconds after which a simulation begun at rest moves as the robot.
    """

    name: str
    channels: tuple[Channel, ...]
    features: tuple[Channel, ...]
    process: np.ndarray
    memory: int = 0
    many: bool = False
    longest: float = float("inf")
    before: float = 0.0

    @property
    @abstractmethod
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of each feature, ``(C,)``."""

    @abstractmethod
    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """All numbers that may be off, in a fixed order; they may depend on what was
        told (a dead band is tried between the speeds told)."""

    @abstractmethod
    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """Predicted observations.

        Args:
            trials: N recorded trials.
            sets: E sets; of each, by trial, the values of the rows that are not
                nominal.
            fine: at the fine step; False = at the coarse one, which is for differences.

        Returns:
            Per set, per trial ``(T, n_channels)``; NaN from where it diverged.
        """

    @abstractmethod
    def joint_windows(self, trial: Trial) -> Windows:
        """Windows over which motion is compared; they may overlap."""

    @abstractmethod
    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """Features of observations or predictions, ``(..., W, C)``.

        Args:
            trial: recorded trial.
            observed: ``(..., T, n_channels)``, recorded or simulated.
            windows: W windows into the trial.
        """

    @abstractmethod
    def effect(self, term: str, values: Mapping[str, float]) -> Effect | None:
        """The effect of an explanation.

        Args:
            term: name of the explanation.
            values: of its rows.
        """

    def motion(self, features: np.ndarray) -> np.ndarray:
        """How fast each feature moved, ``(N, C)``: noise may grow with it."""
        return np.abs(features)

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
