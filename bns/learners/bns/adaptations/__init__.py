"""Adaptations to damage (thesis 4.2.8): what each run resets, and when.

"On damage" adaptations are told when damage came, as in the dissertation: they act
once, before the first trial that follows the first damaged one (until then nothing
has been seen of it). All are settings of single runs in a batch.

Those beyond the settings of `AdaptationConfig` are one file each, found by name. Such a
module has `DOC` (one line), `PARAMETERS` (name -> default) and

    def resets(trial, onset, **parameters) -> set[str]

which gives what a run resets before trial `trial`: any of "population", "simulator"
(SNN) and "data" (training patterns). `onset` is the run's first damaged trial, -1 for
none; an adaptation that uses it has to be told of the damage.
"""

import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike

from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import RunConfig
from bns.experiment.task_settings import metres_per_second


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
            [parse(text) for text in config.adaptation.extra] for config in self.configs
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
        return {part: np.array([part in parts for parts in wanted]) for part in PARTS}

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


PARTS = ("population", "simulator", "data")


@dataclass(frozen=True)
class Extra:
    """An adaptation with its parameters' values."""

    name: str
    parameters: tuple[tuple[str, float], ...]
    function: Callable[..., set[str]]

    def resets(self, trial: int, onset: int) -> set[str]:
        """What a run resets before a trial; see `bns.learners.bns.adaptations`.

        Raises:
            BnsError: the adaptation names something that cannot be reset.
        """
        parts = self.function(trial, onset, **dict(self.parameters))
        for part in parts:
            if part not in PARTS:
                raise UnknownNameError(f"part reset by {self.name}", part, PARTS)
        return parts


@cache
def names() -> tuple[str, ...]:
    """The adaptations that exist, sorted."""
    return tuple(sorted(i.name for i in pkgutil.iter_modules(__path__)))


def describe(name: str) -> str:
    """An adaptation in one line."""
    return str(_module(name).DOC)


def parse(text: str) -> Extra:
    """An adaptation from `NAME` or `NAME:PARAMETER=VALUE,...`.

    Raises:
        UnknownNameError: no such adaptation or parameter.
        BnsError: a value that is no positive number.
    """
    name, _, rest = text.partition(":")
    module = _module(name)
    values = dict(module.PARAMETERS)
    for piece in filter(None, rest.split(",")):
        key, _, value = piece.partition("=")
        if key not in values:
            raise UnknownNameError(f"parameter of {name}", key, values)
        values[key] = _number(text, value)
    return Extra(name, tuple(values.items()), module.resets)


def _module(name: str) -> ModuleType:
    if name not in names():
        raise UnknownNameError("adaptation", name, names())
    return import_module(f"{__name__}.{name}")


def _number(text: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not 0 < number < float("inf"):
        raise BnsError(
            f"{value!r} in adaptation {text!r} is not allowed: give a positive number, "
            "as in population_reset_every:trials=10."
        )
    return number
