"""Cases of the withheld-effect bench: recordings with an answer kept apart.

A case is a recording of a "real" robot (`Stand`): the nominal model, itself slightly
wrong, with a hidden effect (or two, or none, or one that the library lacks). How strong
the effect is, is drawn relative to what the recording can show.

On disk a case is a dataset directory (`worlds/data/dataset.py`) called by its name; all
answers lie in one `answers.json` elsewhere, by name: the attributes of `Answer`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.gap.bench.faults import faulty
from bns.gap.decomposition import descent, levels
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.linear import KAPPA
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.refit import newton
from bns.gap.decomposition.row import Row
from bns.gap.decomposition.singles import Singles
from bns.gap.models.base import PLANE, GapModel
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Commands, Trial

SIZES = 0.5, 8.0  # of a single effect over what is detected, drawn evenly in the log
PAIR_SIZES = 2.0, 8.0  # of each of two
LEAST = 0.4  # size below which an effect counts as not excited, and is drawn again
TRIES = 60
SHARES = (0.01, 0.03, 0.1, 0.2, 0.35, 0.6, 1.0)  # of the largest departure, tried
SEEN = float(np.sqrt(2 * (KAPPA + 3.0)) + 1.28)
"""whitened length of what is found nine times in ten: its evidence pays for itself"""
ALIKE = 1.68
"""noise units between what two do at which they are confused in a fifth of the cases"""
NEAREST = 8  # explanations that are fitted to what a hidden one does


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


@dataclass(frozen=True)
class Hidden:
    """An explanation with its values.

    Attributes:
        term: its name.
        values: of its rows, by name.
        effect: that it is.
        magnitude: the value, or the length of several.
    """

    term: str
    values: Mapping[str, float]
    effect: Effect
    magnitude: float


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
        hidden = (
            off_library[int(rng.integers(len(off_library)))]
            if off_library
            else stand.unlisted(rng)
        )
        answer = replace(answer, effects=(str(hidden),))
        trials = stand.record(told, [*reality, hidden], seed)
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
        taken |= {name for item in found for name in _aliases(problem, item.term)}
        pool = [row for row in pool if _stem(row.term) not in taken]
        pool = [row for row in pool if row.term == wanted] or pool
        size = float(np.exp(rng.uniform(*np.log(span))))
        made = drawn(rng, problem, point, pool, size * SEEN)
        if made is not None:
            found.append(made)
        if len(found) == count:
            break
    return found


def _aliases(problem: Problem, term: str) -> set[str]:
    rows = [row for row in problem.rows if row.term == term]
    return {_stem(name) for row in rows for name in row.aliases}


def _stem(name: str) -> str:
    """The effect that a name begins with."""
    return name.partition("[")[0].partition(".")[0].partition("@")[0]


def drawn(
    rng: np.random.Generator,
    problem: Problem,
    point: Point,
    pool: Sequence[Row],
    length: float,
) -> Hidden | None:
    """A row, evenly over effects, with about a whitened length; None = not excited.

    Args:
        rng: the only source of randomness.
        problem: a recording without an effect.
        point: the nominal model on it.
        pool: rows to draw from.
        length: of what the effect does, in deviations.
    """
    effects = sorted({_stem(row.term) for row in pool})
    effect = effects[int(rng.integers(len(effects)))]
    rows = [row for row in pool if _stem(row.term) == effect]
    row = rows[int(rng.integers(len(rows)))]
    up = row.high > row.nominal and (row.low >= row.nominal or rng.random() < 0.5)
    others = [item for item in rows if item.term == row.term and item is not row]
    turn = float(rng.uniform(-np.pi, np.pi))
    plane = others and row.name.rpartition(".")[2] in PLANE

    def values(size: float) -> dict[str, float]:
        """Of the rows of the effect; in a plane they are a size and a direction."""
        if not plane:
            return {row.name: row.nominal + size}
        ways = zip((row, others[0]), (np.cos(turn), np.sin(turn)), strict=True)
        return {item.name: abs(size) * way for item, way in ways}

    sizes = _sizes(row, up)
    if not len(sizes):
        return None
    made = [_effect(problem, row.term, values(float(s))) for s in sizes]
    lengths = np.nan_to_num(_lengths(problem, point, made), posinf=0.0, neginf=0.0)
    if lengths.max() < 0.7 * length:
        return None
    size = _of_length(sizes, lengths, length, stepped=row.stepped)
    chosen = values(size)
    hidden = _effect(problem, row.term, chosen)
    (reached,) = _lengths(problem, point, [hidden])
    most = np.inf if row.stepped else 3 * max(length, SEEN)
    if not LEAST * SEEN < reached < most:
        return None
    magnitude = abs(size) if plane else row.nominal + size
    return Hidden(row.term, chosen, hidden, float(magnitude))


def _sizes(row: Row, up: bool) -> np.ndarray:
    """Departures of a row that are tried, the smallest first."""
    edge = (row.high if up else row.low) - row.nominal
    steps = [v - row.nominal for v in row.levels if (v > row.nominal) == up]
    found = {abs(v) for v in steps} if row.stepped else {abs(edge) * s for s in SHARES}
    return np.sign(edge) * np.array(sorted(found))


def _of_length(
    sizes: np.ndarray, lengths: np.ndarray, wanted: float, *, stepped: bool
) -> float:
    """The departure whose effect is about so long.

    Args:
        sizes: departures that were tried, of one sign, ``(S,)``.
        lengths: of what they do, in deviations, ``(S,)``.
        wanted: length.
        stepped: whether only those that were tried can be.
    """
    if stepped:
        return float(sizes[np.abs(np.log(np.maximum(lengths, 1e-9) / wanted)).argmin()])
    grown = np.append(0.0, np.maximum.accumulate(lengths))
    size = float(np.interp(wanted, grown, np.append(0.0, np.abs(sizes))))
    return size * float(np.sign(sizes[0]))


def _effect(problem: Problem, term: str, values: Mapping[str, float]) -> Effect:
    found = problem.model.effect(term, values)
    if found is None:
        raise BnsError(f"{term!r} is a nuisance: no effect that a case can hide.")
    return found


def _features(problem: Problem, effects: Sequence[Effect]) -> np.ndarray:
    """Features of effects, the nominal model's first, ``(E + 1, N, C)``."""
    sets = [(), *((effect,) for effect in effects)]
    made = problem.model.simulate(problem.trials, sets)
    return np.stack(
        [
            np.concatenate(
                [
                    problem.model.compare(trial, path, windows)
                    for trial, path, windows in zip(
                        problem.trials, paths, problem.windows, strict=True
                    )
                ]
            )
            for paths in made
        ]
    )


def _lengths(problem: Problem, point: Point, effects: Sequence[Effect]) -> np.ndarray:
    """What effects change, in deviations of independent residuals, ``(E,)``; what
    slack and nuisances could as well be is left out."""
    base, *made = _features(problem, effects)
    linear = point.linear
    prior = linear.prior(())
    used = np.flatnonzero(prior)
    design = linear.design[..., used].reshape(-1, len(used)) * prior[used]
    weight = linear.weight.ravel() / linear.lam
    heavy = design * weight[:, None]
    curvature = heavy.T @ design + np.eye(len(used))
    found = []
    for path in made:
        change = np.where(problem.seen, path - base, 0.0)
        change = point.noise.innovations(change).ravel()
        pull = heavy.T @ change
        square = weight @ change**2 - pull @ np.linalg.solve(curvature, pull)
        found.append(np.sqrt(max(square, 0.0)))
    return np.array(found)


def _answered(
    answer: Answer, problem: Problem, point: Point, found: Sequence[Hidden]
) -> Answer:
    effects = [item.effect for item in found]
    lengths = _lengths(problem, point, effects)
    return replace(
        answer,
        names=tuple(item.term for item in found),
        effects=tuple(str(effect) for effect in effects),
        magnitudes=tuple(item.magnitude for item in found),
        sizes=tuple((lengths / SEEN).tolist()),
        aliases=tuple(alike(problem, point, item) for item in found),
    )


def alike(problem: Problem, point: Point, item: Hidden) -> tuple[str, ...]:
    """The explanations that a recording cannot tell from a hidden one, itself included.

    Each of those that come nearest by themselves is fitted to what the hidden one alone
    would do.

    Args:
        problem: a recording; its commands and its noise count.
        point: the nominal model on it.
        item: the hidden effect.
    """
    base, shown = _features(problem, [item.effect])
    clean = replace(problem, recorded=np.where(problem.seen, shown, np.nan))
    change = np.where(problem.seen, np.nan_to_num(shown - base), 0.0)
    change = point.noise.innovations(change)
    linear = point.linear.moved(point.linear.target - change)
    found = {item.term, *_always(problem, item.term)}
    for one in Singles(clean, replace(point, linear=linear)).fitted[:NEAREST]:
        values, rest = newton(clean, one.values, {one.name}, point.noise)
        values, rest = levels.zoomed(clean, values, rest, {one.name}, point.noise)
        if point.noise.loss(rest) / point.noise.lam < ALIKE**2:
            found.add(one.name)
    return tuple(sorted(found))


def _always(problem: Problem, term: str) -> set[str]:
    """Explanations known to look like one whatever is commanded."""
    rows = [row for row in problem.rows if row.term == term]
    return {name for row in rows for name in row.aliases}
