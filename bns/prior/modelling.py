"""Learners that look for what is wrong with their model: what they share.

Guesses at the numbers of the model (`bns.prior.unknowns`) are evolved until the model
does what the robot was seen to do, and controllers are evolved in the best of them. The
methods differ in what they look at (`clues`) and in what they try next.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from bns.errors import BnsError
from bns.learners.base import Curves, Panel
from bns.prior.thinking import Desk, Mind, Thinker, ThinkingSettings
from bns.prior.unknowns import Unknowns, varied
from bns.worlds.trial import Trial

ARM = 0.1
"""[m] a turn counts as much as what it moves at this distance; assumed"""


@dataclass(frozen=True, kw_only=True)
class ModellingSettings(ThinkingSettings):
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
        **ThinkingSettings.bounds,
        "guesses": (2, 10_000, "models"),
        "replayed": (1, 10_000, "tests"),
        "fitting": (0, 1, "1"),
    }


class ModellingMind(Mind):
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
        """See `Mind.forget`."""
        super().forget(newest)
        self.clues = self.clues[max(len(self.clues) - newest, 0) :]
        self.misses = self.misses[:, max(self.misses.shape[1] - newest, 0) :]

    @property
    def miss(self) -> np.ndarray:
        """Root mean square over the tests, ``(M,)``."""
        found: np.ndarray = np.sqrt((self.misses**2).mean(1))
        return found


class Modeller(Thinker[ModellingMind]):
    """R runs that look for what is wrong with their model; arguments as `Learner`."""

    Settings = ModellingSettings
    open_loop = True
    columns: ClassVar[Mapping[str, str]] = {
        "worth_seen": "what the controller tried achieved (walking: m; elsewhere the "
        "cost, its sign turned)",
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

    def mind(self) -> ModellingMind:
        """See `Thinker.mind`."""
        return ModellingMind(self.space.size, self.unknowns.nominal)

    @abstractmethod
    def clues(self, trials: Sequence[Trial]) -> np.ndarray:
        """What models are judged by in N trials, ``(N, Q)``, NaN where unseen."""

    def changed(self, mind: ModellingMind) -> None:
        """See `Thinker.changed`; guesses begin anew."""
        super().changed(mind)
        mind.guesses = mind.guesses[:0]
        mind.misses = mind.misses[:0, :0]

    def prepare(self, mind: ModellingMind, desk: Desk) -> None:
        """Fit the models, then evolve in the best one."""
        if len(mind.clues):
            self.fit(mind, desk, desk.room - int(self.rule.fitting * desk.room))
            self.adopt(mind, desk)
        self.evolve(mind, desk, self.unknowns.damages(mind.model[None]))

    def fit(self, mind: ModellingMind, desk: Desk, left: int) -> None:
        """Evolve the guesses on what was seen.

        Args:
            mind: whose guesses.
            desk: to think at.
            left: evaluations to leave.
        """
        tests = len(mind.clues)
        if not len(mind.guesses):
            mind.guesses = self.unknowns.random(self.rule.guesses, desk.rng)
            mind.misses = np.empty((self.rule.guesses, 0))
        new = np.arange(mind.misses.shape[1], tests)
        if desk.room < len(mind.guesses) * len(new):
            mind.guesses = mind.guesses[:0]  # too little is left to judge anything
            mind.misses = mind.misses[:0, :0]
            return
        judged = self.judge(mind, desk, mind.guesses, new)
        mind.misses = np.hstack([mind.misses, judged])
        while (count := min((desk.room - left) // tests, len(mind.guesses))) > 0:
            rows = desk.rng.permutation(len(mind.guesses))[:count]
            points = varied(mind.guesses, mind.miss, rows, desk.rng)
            misses = self.judge(mind, desk, points, np.arange(tests))
            better = np.sqrt((misses**2).mean(1)) < mind.miss[rows]
            mind.guesses[rows[better]] = points[better]
            mind.misses[rows[better]] = misses[better]

    def judge(
        self, mind: ModellingMind, desk: Desk, points: np.ndarray, tests: np.ndarray
    ) -> np.ndarray:
        """How far models are from what was seen, ``(N, T)``, each replay charged.

        Args:
            mind: with the clues.
            desk: to think at.
            points: guesses, ``(N, P)``.
            tests: rows of the clues.
        """
        if not len(tests):
            return np.empty((len(points), 0))
        done = mind.tests[len(mind.tests) - len(mind.clues) :][tests]
        genes = np.tile(done, (len(points), 1))
        damages = self.unknowns.damages(np.repeat(points, len(tests), axis=0))
        made = self.clues(desk.run(genes, damages)).reshape(len(points), len(tests), -1)
        return away(made, mind.clues[tests])

    def adopt(self, mind: ModellingMind, desk: Desk) -> None:
        """Judge the population anew where another guess is the best one now."""
        if not len(mind.guesses):
            return
        best = mind.guesses[mind.miss.argmin()]
        if np.array_equal(best, mind.model) or desk.room < len(mind.genes):
            return
        mind.model = best.copy()
        damages = self.unknowns.damages(mind.model[None]) * len(mind.genes)
        mind.worth = self.task.worth(desk.run(mind.genes, damages))
        mind.keep(self.survivors(mind))

    def learn(self, mind: ModellingMind, seen: Trial, worth: float) -> dict[str, Any]:
        """See `Thinker.learn`: what was seen is to be explained."""
        del worth
        miss = mind.miss.min() if len(mind.guesses) else np.nan
        clue = self.clues([seen])
        mind.clues = np.vstack([mind.clues.reshape(-1, clue.shape[1]), clue])
        most = self.rule.replayed
        mind.misses = mind.misses[:, max(len(mind.clues) - most, 0) :]
        mind.clues = mind.clues[-most:]
        return {"model_miss": float(miss), "numbers": self.best_guess(mind)}

    def best_guess(self, mind: ModellingMind) -> np.ndarray:
        """What is wrong as far as is known, in the effects' units, ``(P,)``.

        Where nothing was fitted yet, nothing is.
        """
        if not len(mind.guesses):
            return self.unknowns.values(mind.model)
        return self.unknowns.values(mind.guesses[mind.miss.argmin()])


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
