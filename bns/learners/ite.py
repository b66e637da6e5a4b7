"""IT&E (Cully et al. 2015): a map of gaits made beforehand, the next one by UCB.

A repertoire (`prior.repertoire`) says what each of thousands of controllers achieves in
a model of the undamaged robot. A Gaussian process over their behaviours, whose mean is
that map, is told what was seen since the robot changed, and the controller with the
highest upper confidence bound is tried next, until one has achieved `stop` of what the
best can be expected to. That one is kept, tried and deployed.

Without a repertoire each run makes a small map in its model (`prior.world`), and
without a model, too, there is nothing but the process: Bayesian optimisation among
random controllers, the floor that a map has to beat.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple, cast

import numpy as np

from bns import seeding
from bns.experiment.config import LearnerSettings
from bns.learners.base import Curves, Learner, Panel, Proposal
from bns.prior import gaussian, repertoire
from bns.prior.archive import Archive
from bns.tasks.base import Space
from bns.worlds.trial import Trial
from bns.worlds.world import CountedWorld

BATCH, FIRST = 20, 5
"""evaluations of a generation of a map made here, and random ones at first"""


@dataclass(frozen=True, kw_only=True)
class IteSettings(LearnerSettings):
    """Settings of IT&E; as in Cully et al. 2015."""

    reach: float = 0.4
    """length scale of the process along behaviours"""
    noise: float = 0.001
    """variance of what is seen about the process"""
    kappa: float = 0.05
    """weight of the standard deviation in the upper confidence bound"""
    stop: float = 0.9
    """a controller is kept once it achieved this share of the best expected"""
    most: int = 20
    """tests after which the best one is kept, whatever it achieved"""
    told: Literal["onset", "never"] = "onset"
    """onset: told when the robot was damaged, as in the original; never: it starts anew
    where the one that is kept achieves less than `drop` of what it did"""
    drop: float = 0.7
    """see told"""
    candidates: int = 2000
    """random controllers to choose from, where there is no map"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "reach": (1e-3, 1000, "1"),
        "noise": (1e-9, 1000, "1"),
        "kappa": (0, 1000, "1"),
        "stop": (0, 1, "1"),
        "most": (1, 10_000, "tests"),
        "drop": (0, 1, "1"),
        "candidates": (2, 100_000, "controllers"),
    }


class Map(NamedTuple):
    """Controllers to choose from.

    Attributes:
        space: of the vectors.
        vectors: ``(N, D)``.
        behaviours: ``(N, B)``, each from 0 to 1.
        worth: what each achieves in the model, ``(N,)``; 0 without one.
        zero, unit: worth that counts as 0 and, above it, as 1.
    """

    space: Space
    vectors: np.ndarray
    behaviours: np.ndarray
    worth: np.ndarray
    zero: float = 0.0
    unit: float = 1.0


class Tests:
    """What one run has seen since its robot changed.

    Attributes:
        at: rows of the map that were tried, in order.
        seen: what they achieved, scaled.
        harm: 1 where they did harm, see `harmed`.
        next: row that is tried now.
        best: row that is deployed.
        foreseen: what `next` is expected to achieve, scaled.
        done: whether one is kept.
    """

    def __init__(self) -> None:
        self.at: list[int] = []
        self.seen: list[float] = []
        self.harm: list[float] = []
        self.next = self.best = 0
        self.foreseen, self.done = 0.0, False

    def forget(self, newest: int = 0) -> None:
        """Forget all tests but so many of the newest."""
        first = len(self.at) - newest
        self.at, self.seen = self.at[first:], self.seen[first:]
        self.harm = self.harm[first:]


class Ite(Learner):
    """R runs of IT&E; arguments as `Learner`."""

    Settings = IteSettings
    deploys = True
    columns: ClassVar[Mapping[str, str]] = {
        "worth_foreseen": "what the controller tried was expected to achieve "
        "(walking: m; elsewhere the cost, its sign turned)",
        "worth_seen": "what it achieved",
        "tests": "different controllers tried since the robot changed",
        "harmed": "1 where the robot fell, strained a servo or came too near a lamp",
    }
    figures = (
        Curves(
            name="worth",
            title="What was expected and what was seen",
            caption="What the controller tried was expected to achieve, and did. "
            "{band}",
            label="achieved (walking: m)",
            panels=(
                Panel("worth_foreseen", "expected"),
                Panel("worth_seen", "seen"),
            ),
            shared=True,
        ),
        Curves(
            name="tests",
            title="Tests since the robot changed",
            caption="Different controllers tried since then. {band}",
            label="tests",
            panels=(Panel("tests", "since the robot changed"),),
        ),
    )

    def begin(self) -> None:
        """See `Learner.begin`.

        Raises:
            UnknownNameError: no such repertoire.
            FormatError: a damaged one.
            BnsError: one of another robot, model or task.
        """
        self.rule = cast(IteSettings, self.config.settings)
        self.tests = [Tests() for _ in range(self.runs)]
        self.maps: list[Map] = []
        self._made = [np.empty((0, 0))] * 3
        if name := self.config.prior.repertoire:
            found = repertoire.check(repertoire.read(name), self.config)
            shared = self._map(
                found.space(self.task),
                found.vectors(self.task),
                found.behaviours,
                found.worth,
            )
            self.maps = [shared] * self.runs
        elif not self.models:
            self.maps = [self._blank(replicate) for replicate in self.replicates]

    def _map(self, space: Space, vectors: Any, behaviours: Any, worth: Any) -> Map:
        if self.task.from_zero:
            return Map(space, vectors, behaviours, worth)
        low, high = float(worth.min()), float(worth.max())
        unit = max(high - low, 1e-9)
        return Map(space, vectors, behaviours, (worth - low) / unit, low, unit)

    def _blank(self, replicate: int) -> Map:
        """Random controllers of which nothing is known, near if their genes are."""
        space = self.task.searched
        rng = seeding.generator(self.config.seed, "ite", replicate)
        vectors = space.random(self.rule.candidates, rng)
        width = np.maximum(space.high - space.low, 1e-12)
        places = (vectors - space.low) / width / np.sqrt(space.size)
        unit = 1.0 if self.task.from_zero else np.nan  # from what is seen first
        return Map(space, vectors, places, np.zeros(len(vectors)), 0.0, unit)

    def _explore(self, replicate: int, model: CountedWorld) -> Archive:
        """A small map, made with all evaluations of a run's model."""
        space, archive = self.task.searched, None
        width, generation = np.maximum(space.high - space.low, 1e-12), 0
        while model.left:
            count = min(BATCH, model.left)
            rng = seeding.generator(self.config.seed, "ite-map", replicate, generation)
            if archive is None or generation < FIRST:
                genes = (space.random(count, rng) - space.low) / width
            else:
                genes = archive.bred(count, rng)
            tried = space.controllers(space.low + genes * width)
            first = seeding.integer(
                self.config.seed, "ite-model", replicate, generation
            )
            seeds = [first + at for at in range(count)]
            trials = self.task.execute(model, tried, trial=0, seeds=seeds)
            seen = self.task.behaviour(trials)
            archive = archive or Archive(space.size, seen.shape[1], bins=5)
            archive.add(genes, seen, self.task.worth(trials))
            generation += 1
        return cast(Archive, archive)

    def _make_maps(self) -> None:
        """Maps of all runs, each in its own model."""
        pairs = zip(self.replicates, self.models, strict=True)
        made = [self._explore(replicate, model).state() for replicate, model in pairs]
        self._take([[m["genes"], m["behaviours"], m["worth"][:, None]] for m in made])

    def _take(self, made: Sequence[Sequence[np.ndarray]]) -> None:
        """Use maps made here: genes, behaviours and worth of each run."""
        space = self.task.searched
        width = space.high - space.low
        self.maps = [
            self._map(space, space.low + genes * width, behaviours, worth[:, 0])
            for genes, behaviours, worth in made
        ]
        self._counts = np.array([len(genes) for genes, *_ in made], np.int64)
        self._made = [np.concatenate(arrays) for arrays in zip(*made, strict=True)]

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`."""
        if not self.maps:
            self._make_maps()
        for run, (tests, known) in enumerate(zip(self.tests, self.maps, strict=True)):
            if self.rule.told == "onset" and trial == self.onsets[run] + 1 > 0:
                tests.forget()
            self._choose(tests, known)
        tried, best = (
            [
                known.space.controllers(known.vectors[[row]])[0]
                for known, row in zip(self.maps, rows, strict=True)
            ]
            for rows in ([t.next for t in self.tests], [t.best for t in self.tests])
        )
        same = all(tests.next == tests.best for tests in self.tests)
        return Proposal(tried, None if same else best)

    def _choose(self, tests: Tests, known: Map) -> None:
        """What is tried next, and what would be deployed."""
        rule, at, seen = self.rule, np.array(tests.at, int), np.array(tests.seen)
        rise, spread = gaussian.posterior(
            known.behaviours[at],
            seen - known.worth[at],
            known.behaviours,
            reach=rule.reach,
            noise=rule.noise,
        )
        mean = known.worth + rise
        tests.best = int(at[seen.argmax()]) if len(at) else int(mean.argmax())
        tests.done = len(at) > 0 and (
            bool(seen.max() >= rule.stop * mean.max()) or len(set(at)) >= rule.most
        )
        wanted = self.wanted(tests, known, mean, spread)
        tests.next = tests.best if tests.done else int(wanted.argmax())
        tests.foreseen = float(mean[tests.next])

    def wanted(
        self, tests: Tests, known: Map, mean: np.ndarray, spread: np.ndarray
    ) -> np.ndarray:
        """How much each controller is worth trying, ``(N,)``: here the UCB.

        Args:
            tests: of the run so far.
            known: its map.
            mean, spread: what each is expected to achieve, and its standard deviation.
        """
        del tests, known
        found: np.ndarray = mean + self.rule.kappa * spread
        return found

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`."""
        del trial, best
        worth, harm = self.task.worth(tried), harmed(tried)
        foreseen = np.empty(self.runs)
        for run, tests in enumerate(self.tests):
            seen = self._scaled(run, float(worth[run]))
            known = self.maps[run]
            foreseen[run] = known.zero + tests.foreseen * known.unit
            fell_short = tests.done and seen < self.rule.drop * max(tests.seen)
            tests.at.append(tests.next)
            tests.seen.append(seen)
            tests.harm.append(float(harm[run]))
            if self.rule.told == "never" and fell_short:
                tests.forget(newest=1)
        count = np.array([float(len(set(tests.at))) for tests in self.tests])
        return {
            "worth_foreseen": foreseen,
            "worth_seen": worth,
            "tests": count,
            "harmed": harm,
        }

    def _scaled(self, run: int, worth: float) -> float:
        known = self.maps[run]
        if np.isnan(known.unit):
            unit = max(abs(worth), 1e-9)
            known = known._replace(zero=worth - unit, unit=unit)
            self.maps[run] = known
        return (worth - known.zero) / known.unit

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`: tests, maps made here, and what models have spent."""
        counts = np.array([len(tests.at) for tests in self.tests], np.int64)
        made = self._made if self.models and self.maps else [np.empty((0, 0))] * 3
        scale = [[m.zero, np.nan_to_num(m.unit)] for m in self.maps]
        return {
            "tests": counts,
            "at": np.concatenate([np.array(t.at, np.int64) for t in self.tests]),
            "seen": np.concatenate([np.array(t.seen, float) for t in self.tests]),
            "harm": np.concatenate([np.array(t.harm, float) for t in self.tests]),
            "scale": np.array(scale if self._counts_scale else [], float).reshape(
                -1, 2
            ),
            "map_counts": getattr(self, "_counts", np.empty(0, np.int64)),
            "map_genes": made[0],
            "map_behaviours": made[1],
            "map_worth": made[2],
            **self.spent(),
        }

    @property
    def _counts_scale(self) -> bool:
        """Whether what counts as 1 was learned from trials, and is to be kept."""
        return not (self.task.from_zero or self.models or self.config.prior.repertoire)

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        self.begin()
        edges = np.cumsum(arrays["tests"])[:-1]
        parts = [np.split(arrays[name], edges) for name in ("at", "seen", "harm")]
        for tests, at, seen, harm in zip(self.tests, *parts, strict=True):
            tests.at, tests.seen, tests.harm = at.tolist(), seen.tolist(), harm.tolist()
        if len(arrays["map_counts"]):
            ends = np.cumsum(arrays["map_counts"])[:-1]
            parts = [
                np.split(arrays[f"map_{name}"], ends)
                for name in ("genes", "behaviours", "worth")
            ]
            self._take(list(zip(*parts, strict=True)))
        for run, (zero, unit) in enumerate(arrays["scale"]):
            if unit:
                self.maps[run] = self.maps[run]._replace(zero=zero, unit=unit)
        self.restore_spent(arrays)


def harmed(trials: Sequence[Trial]) -> np.ndarray:
    """Trials in which the robot fell, strained a servo or came too near a lamp.

    Returns:
        ``(N,)``, 1 or 0.
    """
    outcomes = [trial.outcome for trial in trials]
    found = [
        o.fell or o.overloaded or o.overheated or o.lamp_stops > 0 for o in outcomes
    ]
    return np.array(found, np.float64)


LEARNER = Ite
