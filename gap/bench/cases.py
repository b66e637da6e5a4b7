"""Cases of the withheld-effect bench: recordings with an answer kept apart.

A case is a recording of a "real" robot (`Stand`): the nominal model, itself slightly
wrong, with a hidden effect (or two, or none, or one that the library lacks). How strong
the effect is, is drawn relative to what the recording can show.

On disk a case is a dataset directory (`worlds/data/dataset.py`) called by its name; all
answers lie in one `answers.json` elsewhere, by name: the attributes of `Answer`.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.gap.bench import hidden
from bns.gap.bench.faults import faulty
from bns.gap.bench.hidden import SEEN, Hidden
from bns.gap.decomposition import descent
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Commands, Trial

SIZES = 0.5, 8.0  # of a single effect over what is detected, drawn evenly in the log
PAIR_SIZES = 2.0, 8.0  # of each of two
TRIES = 60


@dataclass(frozen=True)
class Answer:
    """What is true of a case.

    Attributes:
        kind: of case, one of its stand's.
        names: explanations of the hidden effects.
        effects: as text.
        magnitudes: of each.
        sizes: whitened length of what each does over the detected length.
        aliases: per hidden effect, the explanations that this recording cannot tell
            from it (itself included).
        nominal: how the robot departs from its model besides, as text.
        fault: of the data.
    """

    kind: str
    names: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    magnitudes: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    aliases: tuple[tuple[str, ...], ...] = ()
    nominal: tuple[str, ...] = ()
    fault: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Case:
    """A recording with its answer, and what is needed for one without the effect."""

    trials: tuple[Trial, ...]
    answer: Answer
    reality: tuple[Effect, ...]
    commands: tuple[Commands, ...]


class Stand(ABC):
    """A robot that cases are made of.

    Attributes:
        model: its nominal model.
        kinds: of cases that can be made.
    """

    kinds: tuple[str, ...] = ("single", "pair", "none", "fault")

    def __init__(self, model: GapModel):
        self.model = model

    @abstractmethod
    def commands(self, rng: np.random.Generator) -> list[Commands]:
        """What it is told in each trial."""

    @abstractmethod
    def imperfection(self, rng: np.random.Generator) -> list[Effect]:
        """How it departs from its model although nothing is wrong with it."""

    @abstractmethod
    def record(
        self, told: Sequence[Commands], effects: Sequence[Effect], seed: int
    ) -> tuple[Trial, ...]:
        """Run it.

        Args:
            told: commands of each trial.
            effects: what it departs by, in any order.
            seed: of noise.

        Raises:
            BnsError: it cannot run with these effects.
        """

    def problem(self, plain: Sequence[Trial]) -> Problem:
        """A recording without an effect, as it is compared."""
        return Problem.of(plain, self.model)

    def unlisted(self, rng: np.random.Generator) -> Effect:
        """An effect that its model lacks, clearly felt.

        Raises:
            BnsError: none is known.
        """
        del rng
        raise BnsError(f"No effect is known that {self.model.name!r} lacks.")

    def pool(
        self, rng: np.random.Generator, problem: Problem, kind: str
    ) -> Sequence[Row]:
        """Rows to draw from.

        Args:
            rng: the only source of randomness.
            problem: a recording without an effect.
            kind: of case.
        """
        del rng, kind
        return [row for row in problem.rows if not row.nuisance]


def build(
    seed: int,
    kind: str,
    stand: Stand,
    *,
    off_library: Sequence[Effect] = (),
    wanted: str = "",
    sizes: tuple[float, float] | None = None,
) -> Case:
    """Make a case.

    Args:
        seed: of everything in it.
        kind: one of the stand's.
        stand: robot.
        off_library: effects to draw from for "off-library"; outside the registry;
            none = one that the stand knows.
        wanted: name of the explanation to plant; "" = drawn.
        sizes: of the effects over what is detected; None = the usual.

    Raises:
        BnsError: no effect of the kind was found that the robot can run with.
    """
    rng = seeding.generator(seed, "case", kind)
    told = stand.commands(rng)
    reality = tuple(stand.imperfection(rng))
    answer = Answer(kind, nominal=tuple(str(effect) for effect in reality))
    if kind in ("none", "fault"):
        trials = stand.record(told, reality, seed)
        if kind == "fault":
            trials, name = faulty(rng, trials)
            answer = replace(answer, fault=name)
        return Case(tuple(trials), answer, reality, tuple(told))
    if kind == "off-library":
        strange = (
            off_library[int(rng.integers(len(off_library)))]
            if off_library
            else stand.unlisted(rng)
        )
        answer = replace(answer, effects=(str(strange),))
        trials = stand.record(told, [*reality, strange], seed)
        return Case(tuple(trials), answer, reality, tuple(told))
    problem = stand.problem(stand.record(told, reality, seed))
    point = descent.nothing(problem)
    count = 2 if kind == "pair" else 1
    span = sizes or (PAIR_SIZES if count == 2 else SIZES)
    for _ in range(TRIES):
        found = _hidden(rng, stand, problem, point, kind, count, span, wanted)
        if len(found) < count:
            continue
        try:
            effects = [item.effect for item in found]
            trials = stand.record(told, [*reality, *effects], seed)
        except BnsError:  # it cannot stand with that
            continue
        answer = _answered(answer, problem, point, found)
        return Case(tuple(trials), answer, reality, tuple(told))
    raise BnsError(f"No effect could be hidden in case {seed}.")


def _hidden(
    rng: np.random.Generator,
    stand: Stand,
    problem: Problem,
    point: Point,
    kind: str,
    count: int,
    span: tuple[float, float],
    wanted: str,
) -> list[Hidden]:
    """Effects of different kinds, each about as strong as drawn."""
    found: list[Hidden] = []
    for _ in range(TRIES):
        pool = stand.pool(rng, problem, kind)
        taken = {item.effect.name for item in found}
        same = {n for item in found for n in hidden.aliases(problem, item.term)}
        taken |= {hidden.stem(name) for name in same}
        pool = [row for row in pool if hidden.stem(row.term) not in taken]
        pool = [row for row in pool if row.term == wanted] or pool
        size = float(np.exp(rng.uniform(*np.log(span))))
        made = hidden.drawn(rng, problem, point, pool, size * SEEN)
        if made is not None:
            found.append(made)
        if len(found) == count:
            break
    return found


def _answered(
    answer: Answer, problem: Problem, point: Point, found: Sequence[Hidden]
) -> Answer:
    effects = [item.effect for item in found]
    lengths = hidden.lengths(problem, point, effects)
    return replace(
        answer,
        names=tuple(item.term for item in found),
        effects=tuple(str(effect) for effect in effects),
        magnitudes=tuple(item.magnitude for item in found),
        sizes=tuple((lengths / SEEN).tolist()),
        aliases=tuple(hidden.alike(problem, point, item) for item in found),
    )
