"""The transferability approach (Koos et al. 2013): evolve what the model gets right.

Controllers are evolved in a model that is never changed, for three goals at once
(NSGA-II): what they achieve there, how little the robot is expected to differ from it,
and how different they are from each other. What is expected is learned, by a Gaussian
process over what controllers do in the model, from a few tests: of the controller that
is most unlike all tested so far. Then those are tried that achieve most among those
that are expected to transfer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from bns.learners.base import Curves, Panel
from bns.prior import gaussian
from bns.prior.model_learner import (
    Memory,
    ModelLearner,
    ModelLearnerSettings,
    Rollouts,
    ranked,
)
from bns.tasks.base import BOARD, seen_places
from bns.worlds.trial import Trial

PARTS = 3
"""places on the way that say what a controller does"""


@dataclass(frozen=True, kw_only=True)
class TransferSettings(ModelLearnerSettings):
    """Settings of the transferability approach."""

    population: int = 20
    """see ModelLearnerSettings"""
    tests: int = 10
    """tests on a robot that are chosen to learn what transfers"""
    tolerated: float = 0.3
    """disparity up to which a controller counts as one that transfers, as a share of
    the largest that was seen"""
    reach: float = 0.4
    """length scale of the process over what controllers do"""
    noise: float = 0.01
    """variance of what is seen about the process"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        **ModelLearnerSettings.bounds,
        "tests": (1, 10_000, "tests"),
        "tolerated": (0, 1, "1"),
        "reach": (1e-3, 1000, "1"),
        "noise": (1e-9, 1000, "1"),
    }


class TransferMemory(Memory):
    """What one run knows of what transfers.

    Attributes:
        done: what the population does in the model, ``(P, F)``.
        tested: what the tests do in the model, ``(T, F)``.
        model: what the tests achieve in the model, ``(T,)``.
        disparity: how much the robot differed from it, ``(T,)``.
        foreseen: what the one that is tried achieves in the model, ``(1,)``.
        does: what it does there, ``(F,)``.
    """

    def __init__(self, size: int):
        super().__init__(size)
        self.done, self.tested = np.empty((0, 0)), np.empty((0, 0))
        self.disparity, self.model = np.empty(0), np.empty(0)
        self.foreseen, self.does = np.zeros(1), np.empty(0)

    def keep(self, rows: np.ndarray) -> None:
        """See `Memory.keep`."""
        super().keep(rows)
        self.done = self.done[rows]

    def forget(self, newest: int) -> None:
        """See `Memory.forget`."""
        super().forget(newest)
        first = max(len(self.disparity) - newest, 0)
        self.tested, self.model = self.tested[first:], self.model[first:]
        self.disparity = self.disparity[first:]


class Transferability(ModelLearner[TransferMemory]):
    """R runs of the transferability approach; arguments as `Learner`."""

    Settings = TransferSettings
    columns: ClassVar[Mapping[str, str]] = {
        **ModelLearner.columns,
        "worth_foreseen": "what it achieves in the model",
        "disparity": "how much the robot differed from the model",
        "disparity_foreseen": "how much it was expected to",
    }
    figures = (
        Curves(
            name="disparity",
            title="How much the robot differs from the model",
            caption="Of the controller tried, as expected and as seen. {band}",
            label="disparity",
            panels=(
                Panel("disparity_foreseen", "expected"),
                Panel("disparity", "seen"),
            ),
            shared=True,
        ),
    )

    def memory(self) -> TransferMemory:
        """See `ModelLearner.memory`."""
        return TransferMemory(self.space.size)

    def changed(self, memory: TransferMemory) -> None:
        """See `ModelLearner.changed`."""
        self.retake(memory)
        super().changed(memory)

    def does(self, trials: Sequence[Trial]) -> np.ndarray:
        """What controllers do: behaviour, and where they are on the way, ``(N, F)``."""
        return np.hstack([self.task.behaviour(trials), ways(trials)])

    def differs(self, memory: TransferMemory, seen: Trial, worth: float) -> float:
        """How much the robot differed from the model: in places on the way.

        Args:
            memory: with what the controller does in the model.
            seen: the trial.
            worth: what it achieved.
        """
        del worth
        return float(np.linalg.norm(memory.does - self.does([seen])[0]))

    def add(self, memory: TransferMemory, genes: Any, trials: Sequence[Trial]) -> None:
        """See `ModelLearner.add`."""
        super().add(memory, genes, trials)
        does = self.does(trials)
        memory.done = np.vstack([memory.done.reshape(-1, does.shape[1]), does])

    def expected(self, memory: TransferMemory, does: np.ndarray) -> np.ndarray:
        """Disparities that controllers are expected to have, ``(N,)``.

        Args:
            memory: with the tests.
            does: what they do in the model, ``(N, F)``.
        """
        if not len(memory.disparity):
            return np.zeros(len(does))
        usual, unit = memory.disparity.mean(), max(float(memory.disparity.std()), 1e-9)
        rise, _ = gaussian.posterior(
            memory.tested,
            (memory.disparity - usual) / unit,
            does,
            reach=self.rule.reach,
            noise=self.rule.noise,
        )
        return np.maximum(usual + unit * rise, 0.0)

    def survivors(self, memory: TransferMemory) -> np.ndarray:
        """See `ModelLearner.survivors`; by three goals."""
        apart = np.linalg.norm(memory.done[:, None] - memory.done[None], axis=2).mean(1)
        goals = [-memory.worth, self.expected(memory, memory.done), -apart]
        return ranked(np.stack(goals, axis=1))

    def chosen(
        self, memory: TransferMemory, rollouts: Rollouts, trial: int
    ) -> np.ndarray:
        """See `ModelLearner.chosen`: a test, or the best that transfers."""
        del trial
        untested = np.flatnonzero(memory.untested)
        if len(untested) and len(memory.seen) < self.rule.tests:
            row = untested[self.told_most(memory, memory.done[untested], rollouts)]
            return self.take(memory, int(row))
        if len(untested):
            row = untested[self.likeliest(memory, untested)]
            if self.hoped(memory, int(row)) > memory.seen.max(initial=-np.inf):
                return self.take(memory, int(row))
        return self.retake(memory)

    def retake(self, memory: TransferMemory) -> np.ndarray:
        """Genes of the test that achieved most, which is tried again, ``(D,)``."""
        best = int(memory.seen.argmax())
        memory.does, memory.foreseen = memory.tested[best].copy(), memory.model[[best]]
        return np.array(memory.tests[best])

    def take(self, memory: TransferMemory, row: int) -> np.ndarray:
        """Genes of a member of the population, which is tried, ``(D,)``."""
        memory.does, memory.foreseen = memory.done[row].copy(), memory.worth[[row]]
        return np.array(memory.genes[row])

    def hoped(self, memory: TransferMemory, row: int) -> float:
        """What a member of the population may achieve on the robot."""
        return float(memory.worth[row])

    def told_most(
        self, memory: TransferMemory, does: np.ndarray, rollouts: Rollouts
    ) -> int:
        """Which controller is tested: the one most unlike those tested so far.

        Args:
            memory: with the tests.
            does: what those to choose from do in the model, ``(N, F)``.
            rollouts: which the model may run.
        """
        if not len(memory.tested):
            return int(rollouts.rng.integers(len(does)))
        apart = np.linalg.norm(does[:, None] - memory.tested[None], axis=2).min(1)
        return int(apart.argmax())

    def likeliest(self, memory: TransferMemory, rows: np.ndarray) -> int:
        """Which of some rows ``(N,)`` achieves most of those expected to transfer."""
        disparity = self.expected(memory, memory.done[rows])
        limit = self.rule.tolerated * memory.disparity.max(initial=0.0)
        good = disparity <= max(limit, float(disparity.min()))
        return int(np.where(good, memory.worth[rows], -np.inf).argmax())

    def learn(
        self, memory: TransferMemory, seen: Trial, worth: float
    ) -> dict[str, Any]:
        """See `ModelLearner.learn`: how much the robot differed."""
        disparity = self.differs(memory, seen, worth)
        expected = self.expected(memory, memory.does[None])[0]
        width = len(memory.does)
        memory.tested = np.vstack([memory.tested.reshape(-1, width), memory.does])
        memory.disparity = np.append(memory.disparity, disparity)
        memory.model = np.append(memory.model, memory.foreseen)
        return {
            "worth_foreseen": float(memory.foreseen[0]),
            "disparity": disparity,
            "disparity_foreseen": float(expected),
        }


def ways(trials: Sequence[Trial]) -> np.ndarray:
    """Places on the way from the start, as shares of the board, ``(N, 2 PARTS)``."""
    found = []
    for trial in trials:
        places = seen_places(trial.command_poses_world)
        last = len(places) - 1
        rows = [-(-last * part // PARTS) for part in range(1, PARTS + 1)]
        found.append(((places[rows] - places[0]) / (2 * np.array(BOARD))).ravel())
    return np.array(found)


LEARNER = Transferability
