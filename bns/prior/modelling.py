"""Learners that look for what is wrong with their model: what they share.

Guesses at the numbers of the model are evolved until the model does what the robot was
seen to do, and controllers are evolved in the best of them. The methods differ in what
they look at (`clues`) and in what they try next.

A number that may be wrong is an effect with a range: one is
"wheel_gain:wheel=left,factor=0.2..1.2". All of them together (`Unknowns`) are a point
in a cube, each coordinate from 0 to 1.
"""

import re
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from bns.errors import BnsError
from bns.learners.base import Curves, Panel
from bns.prior.model_learner import (
    Memory,
    ModelLearner,
    ModelLearnerSettings,
    Rollouts,
    inside,
)
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial

_RANGE = re.compile(r"(\w+)=(-?[\d.]+?)\.\.(-?[\d.]+)")
PULL, APART, STEP, TAKEN = 0.5, 0.6, 0.02, 0.9
"""share of the way to the best guess, of the difference of two, standard deviation of a
step, and share of coordinates that move; with a stronger pull all guesses were soon
alike, and later tests found none that fitted"""
SWAPPED, ANEW = 0.25, 0.15
"""shares of children in which two coordinates are exchanged, or one is drawn anew"""


class Unknowns:
    """What may be wrong with a robot.

    Args:
        texts: an effect each, one of its numbers as a range.

    Attributes:
        nominal: where nothing is wrong, ``(P,)``.

    Raises:
        BnsError: no range, or an effect that there is not.
    """

    def __init__(self, texts: Sequence[str]):
        self._texts, ranges, nominal = [], [], []
        for text in texts:
            found = _RANGE.search(text)
            if found is None or not float(found[2]) < float(found[3]):
                raise BnsError(
                    f"{text!r} is no effect with a range: write for example "
                    "wheel_gain:wheel=left,factor=0.2..1.2."
                )
            written = _RANGE.sub(r"\1={:.6g}", text)
            effect = Damage.parse([written.format(float(found[2]))]).events[0].effect
            named = {item.name: item.nominal for item in effect.parameters}
            self._texts.append(written)
            ranges.append((float(found[2]), float(found[3])))
            nominal.append(named[found[1]])
        self.low, self._high = np.array(ranges).reshape(-1, 2).T
        self.nominal = ((np.array(nominal) - self.low) / self._width).clip(0, 1)

    def __len__(self) -> int:
        return len(self._texts)

    @property
    def _width(self) -> np.ndarray:
        return self._high - self.low

    def values(self, points: np.ndarray) -> np.ndarray:
        """In the effects' own units, shape as `points`."""
        found: np.ndarray = self.low + points * self._width
        return found

    def damages(self, points: np.ndarray) -> list[Damage]:
        """What is wrong with each of N robots.

        Args:
            points: ``(N, P)``.
        """
        return [
            Damage.parse(
                text.format(value) for text, value in zip(self._texts, row, strict=True)
            )
            for row in self.values(points)
        ]

    def random(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Guesses: the model as it is, and others anywhere, ``(count, P)``."""
        points = rng.random((count, len(self)))
        points[0] = self.nominal
        return points


def varied(
    points: np.ndarray, misses: np.ndarray, rows: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Children of guesses, by differential evolution (Storn and Price 1997).

    Each is drawn half-way to the best one and moved along the difference of two others
    ("current to best"), in most coordinates, and a little by chance. Some exchange two
    coordinates instead, or get one anew: what seems wrong with one leg may be wrong
    with another. (Two numbers alone are found sooner without.)

    Args:
        points: ``(M, P)``.
        misses: how wrong each was, ``(M,)``.
        rows: of the parents, ``(N,)``.
        rng: the only source of randomness.

    Returns:
        ``(N, P)``.
    """
    best = points[misses.argmin()]
    one, other = rng.integers(len(points), size=(2, len(rows)))
    parents = points[rows]
    moved = parents + PULL * (best - parents) + APART * (points[one] - points[other])
    moved += STEP * rng.standard_normal(moved.shape)
    taken = rng.random(moved.shape) < TAKEN
    children = inside(np.where(taken, moved, parents))
    kinds = rng.random(len(rows)) if points.shape[1] > 2 else np.ones(len(rows))
    for row in np.flatnonzero(kinds < SWAPPED + ANEW):
        children[row] = parents[row]
        first, second = rng.integers(parents.shape[1], size=2)
        if kinds[row] < SWAPPED:
            children[row, [first, second]] = parents[row, [second, first]]
        else:
            children[row, first] = rng.random()
    return children


ARM = 0.1
"""[m] a turn counts as much as what it moves at this distance; assumed"""


@dataclass(frozen=True, kw_only=True)
class ModellingSettings(ModelLearnerSettings):
    """Settings of learners that look for what is wrong with their model."""

    guesses: int = 8
    """models that are kept"""
    replayed: int = 3
    """tests that guesses are judged by, the newest"""
    fitting: float = 0.5
    """share of a trial's evaluations that is spent on guesses"""
    unknown: tuple[str, ...] = ()
    """what may be wrong, as effects with a range, wheel_gain:wheel=left,factor=0.2..1;
    empty = what the task says"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        **ModelLearnerSettings.bounds,
        "guesses": (2, 10_000, "models"),
        "replayed": (1, 10_000, "tests"),
        "fitting": (0, 1, "1"),
    }


class ModellingMemory(Memory):
    """What one run knows, its guesses at the model among it.

    Attributes:
        clues: what was seen in the newest tests, ``(T, Q)``.
        guesses: points of `Unknowns`, the population of models, ``(M, P)``.
        misses: how far each model is from what was seen in each test, ``(M, T)``.
        model: the guess in which the controllers were evolved last, ``(P,)``.
    """

    def __init__(self, size: int, nominal: np.ndarray):
        super().__init__(size)
        self.clues, self.misses = np.empty((0, 0)), np.empty((0, 0))
        self.guesses, self.model = np.empty((0, len(nominal))), nominal.copy()

    def forget(self, newest: int) -> None:
        """See `Memory.forget`."""
        super().forget(newest)
        self.clues = self.clues[max(len(self.clues) - newest, 0) :]
        self.misses = self.misses[:, max(self.misses.shape[1] - newest, 0) :]

    @property
    def best(self) -> np.ndarray:
        """The guess that explains most, ``(P,)``; without guesses `model`."""
        if not len(self.guesses):
            return self.model
        return np.asarray(self.guesses[self.miss.argmin()])

    @property
    def miss(self) -> np.ndarray:
        """Root mean square over the tests, ``(M,)``."""
        found: np.ndarray = np.sqrt((self.misses**2).mean(1))
        return found


class Modeller(ModelLearner[ModellingMemory]):
    """R runs that look for what is wrong with their model; arguments as `Learner`."""

    Settings = ModellingSettings
    open_loop = True
    columns: ClassVar[Mapping[str, str]] = {
        **ModelLearner.columns,
        "model_miss": "how far the best model is from what was seen in the tests (m; "
        "back-to-reality: as worth_seen)",
    }
    figures = (
        Curves(
            name="model_miss",
            title="What the best model gets wrong",
            caption="How far the best guess at the model is from what was seen. {band}",
            label="miss of the best model",
            panels=(Panel("model_miss", "tests remembered"),),
        ),
    )

    def begin(self) -> None:
        """See `Learner.begin`.

        Raises:
            BnsError: nothing is known that may be wrong.
        """
        rule: Any = self.config.settings
        self.unknowns = Unknowns(rule.unknown or self.task.unknowns)
        if not len(self.unknowns):
            raise BnsError(
                f"What may be wrong with robots of the task {self.config.task.name!r} "
                "is not known: give --settings.unknown."
            )
        super().begin()

    def memory(self) -> ModellingMemory:
        """See `ModelLearner.memory`."""
        return ModellingMemory(self.space.size, self.unknowns.nominal)

    @abstractmethod
    def clues(self, trials: Sequence[Trial]) -> np.ndarray:
        """What models are judged by in N trials, ``(N, Q)``, NaN where unseen."""

    def changed(self, memory: ModellingMemory) -> None:
        """See `ModelLearner.changed`; guesses begin anew."""
        super().changed(memory)
        memory.guesses = memory.guesses[:0]
        memory.misses = memory.misses[:0, :0]

    def prepare(self, memory: ModellingMemory, rollouts: Rollouts) -> None:
        """Fit the models, then evolve in the best one."""
        if len(memory.clues):
            self.fit(
                memory, rollouts, rollouts.room - int(self.rule.fitting * rollouts.room)
            )
            self.adopt(memory, rollouts)
        self.evolve(memory, rollouts, self.unknowns.damages(memory.model[None]))

    def fit(self, memory: ModellingMemory, rollouts: Rollouts, left: int) -> None:
        """Evolve the guesses on what was seen.

        Args:
            memory: whose guesses.
            rollouts: which the model may run.
            left: evaluations to leave.
        """
        tests = len(memory.clues)
        if not len(memory.guesses):
            memory.guesses = self.unknowns.random(self.rule.guesses, rollouts.rng)
            memory.misses = np.empty((self.rule.guesses, 0))
        new = np.arange(memory.misses.shape[1], tests)
        if rollouts.room < len(memory.guesses) * len(new):
            memory.guesses = memory.guesses[:0]  # too little is left to judge anything
            memory.misses = memory.misses[:0, :0]
            return
        judged = self.judge(memory, rollouts, memory.guesses, new)
        memory.misses = np.hstack([memory.misses, judged])
        while (count := min((rollouts.room - left) // tests, len(memory.guesses))) > 0:
            rows = rollouts.rng.permutation(len(memory.guesses))[:count]
            points = varied(memory.guesses, memory.miss, rows, rollouts.rng)
            misses = self.judge(memory, rollouts, points, np.arange(tests))
            better = np.sqrt((misses**2).mean(1)) < memory.miss[rows]
            memory.guesses[rows[better]] = points[better]
            memory.misses[rows[better]] = misses[better]

    def judge(
        self,
        memory: ModellingMemory,
        rollouts: Rollouts,
        points: np.ndarray,
        tests: np.ndarray,
    ) -> np.ndarray:
        """How far models are from what was seen, ``(N, T)``, each replay charged.

        Args:
            memory: with the clues.
            rollouts: which the model may run.
            points: guesses, ``(N, P)``.
            tests: rows of the clues.
        """
        if not len(tests):
            return np.empty((len(points), 0))
        done = memory.tests[len(memory.tests) - len(memory.clues) :][tests]
        genes = np.tile(done, (len(points), 1))
        damages = self.unknowns.damages(np.repeat(points, len(tests), axis=0))
        made = self.clues(rollouts.run(genes, damages)).reshape(
            len(points), len(tests), -1
        )
        return away(made, memory.clues[tests])

    def adopt(self, memory: ModellingMemory, rollouts: Rollouts) -> None:
        """Judge the population anew where another guess is the best one now."""
        best = memory.best
        if np.array_equal(best, memory.model) or rollouts.room < len(memory.genes):
            return
        memory.model = best.copy()
        damages = self.unknowns.damages(memory.model[None]) * len(memory.genes)
        memory.worth = self.task.worth(rollouts.run(memory.genes, damages))
        memory.keep(self.survivors(memory))

    def learn(
        self, memory: ModellingMemory, seen: Trial, worth: float
    ) -> dict[str, Any]:
        """See `ModelLearner.learn`: what was seen is to be explained."""
        del worth
        miss = memory.miss.min() if len(memory.guesses) else np.nan
        clue = self.clues([seen])
        memory.clues = np.vstack([memory.clues.reshape(-1, clue.shape[1]), clue])
        most = self.rule.replayed
        memory.misses = memory.misses[:, max(len(memory.clues) - most, 0) :]
        memory.clues = memory.clues[-most:]
        return {"model_miss": float(miss), "numbers": self.best_guess(memory)}

    def best_guess(self, memory: ModellingMemory) -> np.ndarray:
        """What is wrong as far as is known, in the effects' units, ``(P,)``."""
        return self.unknowns.values(memory.best)


def places(trials: Sequence[Trial], most: int = 0) -> np.ndarray:
    """Poses after each command, in metres: ``(N, K, 4)``, NaN beyond a list's end.

    Args:
        trials: N.
        most: commands of the longest list; 0 = of these.
    """
    longest = most or max(len(trial.commands) for trial in trials)
    found = np.full((len(trials), longest, 4), np.nan)
    for row, trial in enumerate(trials):
        x, y, yaw = trial.command_poses_world[1:].T
        turned = ARM * np.cos(yaw), ARM * np.sin(yaw)
        found[row, : len(x)] = np.stack([x, y, *turned], axis=1)
    return found


def away(made: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Root mean square distance along the last axis of what was seen, ``(...)``."""
    both = np.isfinite(made) & np.isfinite(seen)
    square = np.where(both, made - seen, 0.0) ** 2
    found: np.ndarray = np.sqrt(square.sum(-1) / np.maximum(both.sum(-1), 1))
    return found
