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
from bns.prior.breeding import ranked
from bns.prior.thinking import Desk, Mind, Thinker, ThinkingSettings
from bns.tasks.base import BOARD, seen_places
from bns.worlds.trial import Trial

PARTS = 3
"""places on the way that say what a controller does"""


@dataclass(frozen=True, kw_only=True)
class TransferSettings(ThinkingSettings):
    """Settings of the transferability approach."""

    population: int = 20
    """see ThinkingSettings"""
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
        **ThinkingSettings.bounds,
        "tests": (1, 10_000, "tests"),
        "tolerated": (0, 1, "1"),
        "reach": (1e-3, 1000, "1"),
        "noise": (1e-9, 1000, "1"),
    }


class TransferMind(Mind):
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
        """See `Mind.keep`."""
        super().keep(rows)
        self.done = self.done[rows]

    def forget(self, newest: int) -> None:
        """See `Mind.forget`."""
        super().forget(newest)
        first = max(len(self.disparity) - newest, 0)
        self.tested, self.model = self.tested[first:], self.model[first:]
        self.disparity = self.disparity[first:]


class Transferability(Thinker[TransferMind]):
    """R runs of the transferability approach; arguments as `Learner`."""

    Settings = TransferSettings
    columns: ClassVar[Mapping[str, str]] = {
        "worth_seen": "what the controller tried achieved (walking: m; elsewhere the "
        "cost, its sign turned)",
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

    def mind(self) -> TransferMind:
        """See `Thinker.mind`."""
        return TransferMind(self.space.size)

    def changed(self, mind: TransferMind) -> None:
        """See `Thinker.changed`."""
        best = int(mind.seen.argmax())
        mind.does, mind.foreseen = mind.tested[best].copy(), mind.model[[best]]
        super().changed(mind)

    def does(self, trials: Sequence[Trial]) -> np.ndarray:
        """What controllers do: behaviour, and where they are on the way, ``(N, F)``."""
        return np.hstack([self.task.behaviour(trials), ways(trials)])

    def differs(self, mind: TransferMind, seen: Trial, worth: float) -> float:
        """How much the robot differed from the model: in places on the way.

        Args:
            mind: with what the controller does in the model.
            seen: the trial.
            worth: what it achieved.
        """
        del worth
        return float(np.linalg.norm(mind.does - self.does([seen])[0]))

    def add(self, mind: TransferMind, genes: Any, trials: Sequence[Trial]) -> None:
        """See `Thinker.add`."""
        super().add(mind, genes, trials)
        does = self.does(trials)
        mind.done = np.vstack([mind.done.reshape(-1, does.shape[1]), does])

    def expected(self, mind: TransferMind, does: np.ndarray) -> np.ndarray:
        """Disparities that controllers are expected to have, ``(N,)``.

        Args:
            mind: with the tests.
            does: what they do in the model, ``(N, F)``.
        """
        if not len(mind.disparity):
            return np.zeros(len(does))
        usual, unit = mind.disparity.mean(), max(float(mind.disparity.std()), 1e-9)
        rise, _ = gaussian.posterior(
            mind.tested,
            (mind.disparity - usual) / unit,
            does,
            reach=self.rule.reach,
            noise=self.rule.noise,
        )
        return np.maximum(usual + unit * rise, 0.0)

    def survivors(self, mind: TransferMind) -> np.ndarray:
        """See `Thinker.survivors`; by three goals."""
        apart = np.linalg.norm(mind.done[:, None] - mind.done[None], axis=2).mean(1)
        goals = [-mind.worth, self.expected(mind, mind.done), -apart]
        return ranked(np.stack(goals, axis=1))

    def chosen(self, mind: TransferMind, desk: Desk, trial: int) -> np.ndarray:
        """See `Thinker.chosen`: a test, or the best that transfers."""
        del trial
        untested = np.flatnonzero(mind.untested)
        if len(untested) and len(mind.seen) < self.rule.tests:
            row = untested[self.told_most(mind, mind.done[untested], desk)]
            return self.take(mind, int(row))
        if len(untested):
            row = untested[self.likeliest(mind, untested)]
            if self.hoped(mind, int(row)) > mind.seen.max(initial=-np.inf):
                return self.take(mind, int(row))
        best = int(mind.seen.argmax())
        mind.does, mind.foreseen = mind.tested[best].copy(), mind.model[[best]]
        return np.array(mind.tests[best])

    def take(self, mind: TransferMind, row: int) -> np.ndarray:
        """Genes of a member of the population, which is tried, ``(D,)``."""
        mind.does, mind.foreseen = mind.done[row].copy(), mind.worth[[row]]
        return np.array(mind.genes[row])

    def hoped(self, mind: TransferMind, row: int) -> float:
        """What a member of the population may achieve on the robot."""
        return float(mind.worth[row])

    def told_most(self, mind: TransferMind, does: np.ndarray, desk: Desk) -> int:
        """Which controller is tested: the one most unlike those tested so far.

        Args:
            mind: with the tests.
            does: what those to choose from do in the model, ``(N, F)``.
            desk: to think at.
        """
        if not len(mind.tested):
            return int(desk.rng.integers(len(does)))
        apart = np.linalg.norm(does[:, None] - mind.tested[None], axis=2).min(1)
        return int(apart.argmax())

    def likeliest(self, mind: TransferMind, rows: np.ndarray) -> int:
        """Which of some rows ``(N,)`` achieves most of those expected to transfer."""
        disparity = self.expected(mind, mind.done[rows])
        limit = self.rule.tolerated * mind.disparity.max(initial=0.0)
        good = disparity <= max(limit, float(disparity.min()))
        return int(np.where(good, mind.worth[rows], -np.inf).argmax())

    def learn(self, mind: TransferMind, seen: Trial, worth: float) -> dict[str, Any]:
        """See `Thinker.learn`: how much the robot differed."""
        disparity = self.differs(mind, seen, worth)
        expected = self.expected(mind, mind.does[None])[0]
        width = len(mind.does)
        mind.tested = np.vstack([mind.tested.reshape(-1, width), mind.does])
        mind.disparity = np.append(mind.disparity, disparity)
        mind.model = np.append(mind.model, mind.foreseen)
        return {
            "worth_foreseen": float(mind.foreseen[0]),
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
