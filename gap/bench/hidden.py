"""A hidden effect of a case: drawn by how much of it the recording shows, and what the
recording cannot tell from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.errors import BnsError
from bns.gap.decomposition import levels
from bns.gap.decomposition.evidence.linear import KAPPA
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.refit import newton
from bns.gap.decomposition.row import Row
from bns.gap.decomposition.singles import Singles
from bns.gap.models.library import PLANE
from bns.worlds.effects.base import Effect

LEAST = 0.4  # size below which an effect counts as not excited, and is drawn again
SHARES = (0.01, 0.03, 0.1, 0.2, 0.35, 0.6, 1.0)  # of the largest departure, tried
SEEN = float(np.sqrt(2 * (KAPPA + 3.0)) + 1.28)
"""whitened length of what is found nine times in ten: its evidence pays for itself"""
ALIKE = 1.68
"""noise units between what two do at which they are confused in a fifth of the cases"""
NEAREST = 8  # explanations that are fitted to what a hidden one does


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


def stem(name: str) -> str:
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
    effects = sorted({stem(row.term) for row in pool})
    effect = effects[int(rng.integers(len(effects)))]
    rows = [row for row in pool if stem(row.term) == effect]
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
    reach = np.nan_to_num(lengths(problem, point, made), posinf=0.0, neginf=0.0)
    if reach.max() < 0.7 * length:
        return None
    size = _of_length(sizes, reach, length, stepped=row.stepped)
    chosen = values(size)
    hidden = _effect(problem, row.term, chosen)
    (reached,) = lengths(problem, point, [hidden])
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
    return np.stack([problem.features(paths) for paths in made])


def lengths(problem: Problem, point: Point, effects: Sequence[Effect]) -> np.ndarray:
    """What effects change, in deviations of independent residuals, ``(E,)``; what
    slack, nuisances and what the model is unsure of could as well be is left out.

    Args:
        problem: a recording without an effect.
        point: the nominal model on it.
        effects: E of them, each by itself.
    """
    base, *made = _features(problem, effects)
    linear = point.linear
    rows = [problem.rows[number] for number in linear.columns]
    unsure = np.array([row.unsure / row.sd for row in rows])
    prior = np.maximum(linear.prior(()), unsure)
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
    found = {item.term, *aliases(problem, item.term)}
    for one in Singles(clean, replace(point, linear=linear)).fitted[:NEAREST]:
        values, rest = newton(clean, one.values, {one.name}, point.noise)
        values, rest = levels.zoomed(clean, values, rest, {one.name}, point.noise)
        if point.noise.loss(rest) / point.noise.lam < ALIKE**2:
            found.add(one.name)
    return tuple(sorted(found))


def aliases(problem: Problem, term: str) -> set[str]:
    """Explanations known to look like one whatever is commanded."""
    rows = [row for row in problem.rows if row.term == term]
    return {name for row in rows for name in row.aliases}
