"""RTE (Chatzilygeroudis et al. 2018): composes short drives and corrects them.

A repertoire of short drives says where each takes the robot: made in a model
(`prior.world`), or, without one, out of what the first trials drove at random. A
Gaussian process, whose mean is that repertoire, is told where each behaviour of a trial
really led, and a tree search composes the behaviours so that all objectives are
reached. The original plans anew after each behaviour; here a trial is a list that runs
blindly, so all of it is planned before, and what was driven corrects the next plan.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, cast

import numpy as np

from bns import seeding
from bns.experiment.config import LearnerSettings
from bns.learners.base import Curves, Panel, Proposal, RememberingLearner
from bns.prior import driving, gaussian
from bns.tasks.navigation import NavigationTask
from bns.worlds.trial import Trial

STOP = 0.3
"""[s] of standing after each behaviour: then what it does depends on the ones before
by 1 mrad, and without by 60 (measured)"""


@dataclass(frozen=True, kw_only=True)
class RteSettings(LearnerSettings):
    """Settings of RTE; as in Chatzilygeroudis et al. 2018 unless said."""

    evaluations: int = 100
    """lists of random behaviours that the model drives for the repertoire (own)"""
    explored: int = 10
    """random trials that it is made of, where there is no model (own)"""
    bins: int = 20
    """of the repertoire's grid along forward, left and turn (own)"""
    learning: bool = True
    """False: the repertoire is never corrected, the same planner without the process"""
    reach: float = 0.5
    """length scale of the process, in shares of what behaviours range over"""
    noise: float = 0.02
    """variance of what is seen, as a share of the process's (0.01 and 0.5)"""
    doubt: float = 0.02
    """standard deviation of where a behaviour leads that was not driven yet [m, and
    of cosine and sine] (own; there sqrt(0.5) of a repertoire's unit)"""
    iterations: int = 1000
    """of the tree search, for each behaviour"""
    bonus: float = 50.0
    """weight of what is little known in the search, c of UCT"""
    actions: float = 0.5
    """exponent of the widening of actions"""
    outcomes: float = 0.6
    """exponent of the widening of outcomes"""
    discount: float = 0.9
    """of a reward, for each behaviour before it (assumed)"""
    within: float = 0.5
    """plans pass objectives within this share of the task's radius: nobody corrects
    what goes wrong on the way (own)"""
    remembered: int = 300
    """behaviours driven that are learned from, the newest (own)"""
    told: Literal["onset", "never"] = "onset"
    """onset: told when the robot was damaged, and what was driven before is forgotten;
    never: it is forgotten where a list that solved the task does not do so again"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "evaluations": (1, 1e9, "evaluations"),
        "explored": (1, 10_000, "trials"),
        "bins": (1, 1000, "bins"),
        "reach": (1e-3, 1000, "1"),
        "noise": (1e-9, 1000, "1"),
        "doubt": (0, 10, "m"),
        "iterations": (1, 10_000_000, "iterations"),
        "bonus": (0, 1e9, "1"),
        "actions": (0, 1, "1"),
        "outcomes": (0, 1, "1"),
        "discount": (0, 1, "1"),
        "within": (0.01, 1, "1"),
        "remembered": (1, 10_000, "behaviours"),
    }


class Memory:
    """What one run knows; all attributes are arrays.

    Attributes:
        genes: of the repertoire, (left speed, right speed, duration) ``(N, 3)``.
        moved: where each leads, forward, left, turn ``(N, 3)`` [m, m, rad].
        at: rows that were driven since the robot changed, ``(T,)``.
        seen: what came of them, as `driving.targets`, ``(T, 4)``.
        trial: in which, ``(T,)``.
        tried: genes of this trial, ``(B, 3)``.
        rows: theirs in the repertoire, ``(B,)``; none where it explores.
        poses: expected at the start and after each of them, ``(B + 1, 3)``.
        best: genes of the list that did best since the robot changed, ``(B, 3)``.
        best_rows: theirs in the repertoire.
        cost: of that list, and 1 where it solved the task, ``(2,)``.
    """

    def __init__(self) -> None:
        self.genes, self.moved = np.empty((0, 3)), np.empty((0, 3))
        self.at, self.trial = np.empty(0, np.int64), np.empty(0, np.int64)
        self.seen = np.empty((0, 4))
        self.tried, self.rows = np.empty((0, 3)), np.empty(0, np.int64)
        self.poses = np.empty((0, 3))
        self.best, self.best_rows = np.empty((0, 3)), np.empty(0, np.int64)
        self.cost = np.array([np.inf, 0.0])

    def forget(self, before: int) -> None:
        """Forget what was driven before a trial, and which list did best."""
        self._keep(self.trial >= before)
        self.best, self.best_rows = self.best[:0], self.best_rows[:0]
        self.cost = np.array([np.inf, 0.0])

    def add(
        self, rows: np.ndarray, seen: np.ndarray, trial: int, *, remembered: int
    ) -> None:
        """Remember what behaviours did.

        Args:
            rows: theirs in the repertoire, ``(B,)``.
            seen: what came of them, as `driving.targets`, ``(B, 4)``.
            trial: in which.
            remembered: the newest that are kept.
        """
        self.at = np.append(self.at, rows)
        self.seen = np.vstack([self.seen, seen])
        self.trial = np.append(self.trial, np.full(len(rows), trial))
        self._keep(np.arange(len(self.at)) >= len(self.at) - remembered)

    def _keep(self, rows: np.ndarray) -> None:
        self.at, self.seen, self.trial = (
            array[rows] for array in (self.at, self.seen, self.trial)
        )


class Rte(RememberingLearner):
    """R runs of RTE; arguments as `Learner`."""

    Settings = RteSettings
    kinds = ("navigation",)
    deploys = True
    columns: ClassVar[Mapping[str, str]] = {
        "behaviour_miss": "how far from where they were expected behaviours ended, mean"
        " over the trial's, each from where it began [m]; none while it explores",
        "driven": "behaviours driven that are learned from",
        "repertoire": "behaviours to choose from",
    }
    figures = (
        Curves(
            name="behaviour_miss",
            title="What is expected of behaviours, and is not so",
            caption="How far from where it was expected a behaviour of the trial "
            "ended, on average. {band}",
            label="miss of a behaviour (m)",
            panels=(Panel("behaviour_miss", "of the trial's behaviours"),),
        ),
    )

    def begin(self) -> None:
        """See `Learner.begin`."""
        self.rule = cast(RteSettings, self.config.settings)
        self._search = driving.Rule(
            iterations=self.rule.iterations,
            bonus=self.rule.bonus,
            actions=self.rule.actions,
            outcomes=self.rule.outcomes,
            discount=self.rule.discount,
        )
        self.memories = [Memory() for _ in range(self.runs)]
        self._wheels = cast(NavigationTask, self.task)
        encoding = self._wheels.encoding
        self._low, self._high = encoding.low.numpy(), encoding.high.numpy()
        stops = float(self._low[:2].max()) < encoding.dead_band
        self.each = 2 if stops and encoding.max_commands > 1 else 1
        self.most = encoding.max_commands // self.each

    def controllers(self, lists: Sequence[np.ndarray]) -> list[Any]:
        """Lists of behaviours as the task's controllers, each behaviour and a stop.

        Args:
            lists: genes ``(B, 3)`` of each.
        """
        space = self.task.space
        vectors = np.tile(space.low, (len(lists), 1))
        for vector, genes in zip(vectors, lists, strict=True):
            commands = np.tile(self._low, (len(genes), self.each, 1))
            commands[:, 0] = genes
            commands[:, 1:, 2] = np.clip(STOP, self._low[2], self._high[2])
            flat = commands.reshape(-1)
            vector[: len(flat)], vector[-1] = flat, len(flat) // 3
        return space.controllers(vectors)

    def random(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Genes of random lists of the longest length, ``(count, most, 3)``."""
        return rng.uniform(self._low, self._high, (count, self.most, 3))

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`."""
        for run, memory in enumerate(self.memories):
            if self.rule.told == "onset" and trial == self.onsets[run] + 1 > 0:
                memory.forget(before=trial - 1)
            names = ("rte", self.replicates[run], trial)
            rng = seeding.generator(self.config.seed, *names)
            if self.models and not len(memory.genes):
                self._make(run, memory, rng)
            self._choose(memory, trial, rng)
        tried = [memory.tried for memory in self.memories]
        best = [m.best if len(m.best) else m.tried for m in self.memories]
        return Proposal(self.controllers(tried), self.controllers(best))

    def _make(self, run: int, memory: Memory, rng: np.random.Generator) -> None:
        """The repertoire, in a run's model."""
        model = self.models[run]
        genes = self.random(max(min(self.rule.evaluations, model.left), 1), rng)
        seeds = rng.integers(2**31, size=len(genes)).tolist()
        lists = self.controllers(list(genes))
        trials = self.task.execute(model, lists, trial=0, seeds=seeds)
        self._extend(memory, genes.reshape(-1, 3), trials)
        rows = driving.selected(memory.genes, memory.moved, self.rule.bins)
        memory.genes, memory.moved = memory.genes[rows], memory.moved[rows]

    def _extend(
        self, memory: Memory, genes: np.ndarray, trials: Sequence[Trial]
    ) -> None:
        """Take what trials drove into the repertoire."""
        moved, good = driving.displacements(trials, self.each)
        memory.genes = np.vstack([memory.genes, genes[good]])
        memory.moved = np.vstack([memory.moved, moved[good]])

    def _choose(self, memory: Memory, trial: int, rng: np.random.Generator) -> None:
        """What is tried: the list that solved the task, a plan, or anything."""
        explores = not self.models and trial < self.rule.explored
        if explores or not len(memory.genes):
            memory.tried, memory.rows = self.random(1, rng)[0], memory.rows[:0]
            memory.poses = np.empty((0, 3))
        elif memory.cost[1]:
            memory.tried, memory.rows = memory.best.copy(), memory.best_rows.copy()
            memory.poses = self._way(memory)
        else:
            rows, poses = self.planned(memory, rng)
            memory.rows, memory.poses = np.array(rows, np.int64), np.array(poses)
            memory.tried = memory.genes[memory.rows]

    def expected(self, memory: Memory) -> tuple[np.ndarray, np.ndarray]:
        """Where behaviours lead as far as is known.

        Returns:
            mean of x, y, cosine, sine ``(N, 4)``, and their standard deviation in
            units of `settings.doubt`, ``(N,)``.
        """
        prior = driving.targets(memory.moved)
        if not (self.rule.learning and len(memory.at)):
            return prior, np.ones(len(prior))
        does = np.column_stack([memory.moved, memory.genes[:, 2]])
        places = driving.scaled(does, does)
        rise, spread = gaussian.posterior(
            places[memory.at],
            memory.seen - prior[memory.at],
            places,
            reach=self.rule.reach,
            noise=self.rule.noise,
            kernel=gaussian.exponential,
        )
        return prior + rise, spread

    def planned(
        self, memory: Memory, rng: np.random.Generator
    ) -> tuple[list[int], list[driving.Pose]]:
        """See `driving.plan`."""
        means, spread = self.expected(memory)
        within = self.rule.within * self.config.task.radius
        legs = [
            driving.Leg(
                means, self.rule.doubt * spread, (x, y), within, self.rule.discount
            )
            for x, y in self._wheels.route.goals.tolist()
        ]
        start = self._wheels.route.start
        return driving.plan(legs, start, self.most, self._search, rng)

    def _way(self, memory: Memory) -> np.ndarray:
        """Poses that are expected of the list to be tried, ``(B + 1, 3)``."""
        means, _ = self.expected(memory)
        poses = [self._wheels.route.start]
        for x, y, cos, sin in means[memory.rows].tolist():
            turn = float(np.arctan2(sin, cos))
            poses.append(driving.moved_by(poses[-1], x, y, turn))
        return np.array(poses)

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`."""
        del best
        cost, solved = self.task.fitness(tried), self.task.measured(tried)["solved"]
        longest = self._wheels.encoding.max_commands
        predicted = np.full((self.runs, longest + 1, 3), np.nan)
        misses = np.full(self.runs, np.nan)
        for run, memory in enumerate(self.memories):
            ends = memory.poses.repeat(self.each, axis=0)[self.each - 1 :]
            predicted[run, : len(ends)] = ends
            misses[run] = self._learn(memory, trial, tried[run])
            self._rank(memory, trial, float(cost[run]), float(solved[run]))
        return {
            "behaviour_miss": misses,
            "driven": np.array([float(len(m.at)) for m in self.memories]),
            "repertoire": np.array([float(len(m.genes)) for m in self.memories]),
            "predicted": predicted,
        }

    def _learn(self, memory: Memory, trial: int, seen: Trial) -> float:
        """Learn from a trial; what its behaviours missed by [m]."""
        if not len(memory.rows):
            self._extend(memory, memory.tried, [seen])
            return float("nan")
        moved, good = driving.displacements([seen], self.each)
        rows, found = memory.rows[good], driving.targets(moved[good])
        away = np.linalg.norm(found - self.expected(memory)[0][rows], axis=1)
        memory.add(rows, found, trial, remembered=self.rule.remembered)
        return float(away.mean()) if len(away) else float("nan")

    def _rank(self, memory: Memory, trial: int, cost: float, solved: float) -> None:
        """Keep the list that did best, or see that it does not any more."""
        again = np.array_equal(memory.tried, memory.best)
        if again and memory.cost[1] > solved and self.rule.told == "never":
            memory.forget(before=trial)
        if again or cost < memory.cost[0]:
            memory.best, memory.best_rows = memory.tried.copy(), memory.rows.copy()
            memory.cost = np.array([cost, solved])


LEARNER = Rte
