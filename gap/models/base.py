"""What the diagnosis needs of a nominal model: `GapModel`.

The diagnosis knows nothing of robots. A model re-executes recorded commands with
candidate effects and says how observations become features: small pieces of relative
motion, each over one window between two samples, so that an early error does not
spoil all that follows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bns.gap.records import Candidate
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Channel, Trial


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


class GapModel(Protocol):
    """A nominal model that can be simulated with candidate effects.

    Attributes:
        name: of the model.
        channels: what is observed, as in `Trial.channels`.
        features: what is compared, C channels (for a planar robot forward [m], left
            [m], turn [rad] over a window).
        process: standard deviation of what a nominal robot scatters by itself in one
            second of motion, by feature channel, shape ``(C,)``; grows with the square
            root of time. Used until repeats tell better.
        resolution: smallest standard deviation of the measurement of each observed
            channel that is believed, shape ``(n_channels,)``.
    """

    name: str
    channels: tuple[Channel, ...]
    features: tuple[Channel, ...]
    process: np.ndarray
    resolution: np.ndarray

    def candidates(self) -> tuple[Candidate, ...]:
        """All explanations that may be given, in a fixed order."""
        ...

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """What would have been observed, had these effects held.

        The recorded commands are executed again from the observed start of each trial
        (or of each short segment of it), all sets of effects in one batch. Nothing is
        random: noise effects have none here.

        Args:
            trials: N recorded trials.
            effects: E sets of effects; the empty set is the nominal model.

        Returns:
            Per set, per trial: ``(T, n_channels)`` at the trial's own samples; NaN
            from where the simulation diverged.
        """
        ...

    def windows(self, trial: Trial) -> Windows:
        """The windows of a trial, one short horizon, tiling it."""
        ...

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """Features of observations or predictions of a trial.

        Args:
            trial: recorded trial.
            observed: ``(..., T, n_channels)``, recorded or simulated.
            windows: any windows into the trial, also longer ones.

        Returns:
            ``(..., W, C)``.
        """
        ...

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """What went on in each window, by name in words, each ``(W,)``.

        For localising in which regime a gap sits and for the flexible ceiling:
        commands, their signs and changes, heading, position, time.
        """
        ...
