"""Adaptations to damage (thesis 4.2.8): what each run resets, and when.

"On damage" adaptations are told when damage came, as in the dissertation: they act
once, before the first trial that follows the first damaged one (until then nothing
has been seen of it). All are settings of single runs in a batch.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bns.experiment.config import RunConfig
from bns.learners.bns.adaptations import registry
from bns.units import metres_per_second


@dataclass(frozen=True)
class Resets:
    """Which runs reset what before a trial; boolean arrays ``(R,)``.

    Attributes:
        population: a fresh population.
        simulator: a fresh SNN.
        trained: of those, which train it at once on the patterns they have.
        data: no patterns.
    """

    population: np.ndarray
    simulator: np.ndarray
    trained: np.ndarray
    data: np.ndarray


class Adaptations:
    """The schedule of R runs.

    Args:
        configs: one per run.
        onsets: first damaged trial of each run, -1 = none.
    """

    def __init__(self, configs: Sequence[RunConfig], onsets: Sequence[int]):
        self.configs = list(configs)
        self.onsets = np.asarray(onsets, dtype=np.int64)
        self.extras = [
            [registry.parse(text) for text in config.adaptation.extra]
            for config in self.configs
        ]

    def _setting(self, name: str) -> np.ndarray:
        return np.array([getattr(c.adaptation, name) for c in self.configs])

    @property
    def windows(self) -> np.ndarray:
        """Sliding window of each run [patterns], 0 = all."""
        return self._setting("window")

    def damage_known(self, trial: int) -> np.ndarray:
        """Whether a run's damage has been felt before this trial, ``(R,)`` bool."""
        return (self.onsets >= 0) & (trial > self.onsets)

    def resets(self, trial: int) -> Resets:
        """What is reset before `trial`.

        The fresh simulator of `simulator_reset_every` = k comes before trials k, 2k...
        """
        told = (self.onsets >= 0) & (trial == self.onsets + 1)
        restart = told & self._setting("restart")
        every = self._setting("simulator_reset_every")
        due = (every > 0) & (trial > 0) & (trial % np.maximum(every, 1) == 0)
        extra = self._extra(trial)
        fresh = told & self._setting("simulator_reset")
        other = restart | due | extra["simulator"]
        return Resets(
            population=restart
            | (told & self._setting("population_reset"))
            | extra["population"],
            simulator=other | fresh,
            trained=other | (fresh & ~self._setting("simulator_reset_untrained")),
            data=restart | (told & self._setting("data_reset")) | extra["data"],
        )

    def _extra(self, trial: int) -> dict[str, np.ndarray]:
        """What the adaptations of `extra` reset, each part ``(R,)`` bool."""
        wanted = [
            {part for extra in extras for part in extra.resets(trial, int(onset))}
            for extras, onset in zip(self.extras, self.onsets, strict=True)
        ]
        return {
            part: np.array([part in parts for parts in wanted])
            for part in registry.PARTS
        }

    def since_damage(
        self, trial: int, usual: ArrayLike, after: ArrayLike
    ) -> np.ndarray:
        """A setting of each run at a trial, ``(R,)``.

        Args:
            trial: its number.
            usual: before damage is known, of each run or of all.
            after: once it is; 0 = unchanged.
        """
        new = np.asarray(after)
        return np.where(self.damage_known(trial) & (new > 0), new, usual)

    def magnitudes(self, trial: int, usual: Sequence[float]) -> np.ndarray:
        """Size of a mutation of each run at a trial, in the learner's own unit.

        Args:
            trial: its number.
            usual: before damage is known, of each run.
        """
        after = self._setting("mutation_magnitude_after")
        return self.since_damage(trial, usual, after)

    def mutation(self, trial: int) -> tuple[np.ndarray, np.ndarray]:
        """Mutation rate ``(R,)`` and magnitude ``(R, 3)`` [m/s, m/s, s] at a trial."""
        each = [config.evolution for config in self.configs]
        rates = self.since_damage(
            trial, [e.mutation_rate for e in each], self._setting("mutation_rate_after")
        )
        sizes = self.magnitudes(trial, [e.mutation_magnitude for e in each])
        found = []
        for evolution, size in zip(each, sizes, strict=True):
            usual = evolution.mutation_magnitude
            grown = size / usual if usual else 1.0
            speed = metres_per_second(usual) * grown
            found.append([speed, speed, evolution.duration_magnitude * grown])
        return rates.astype(np.float32), np.array(found, np.float32)
