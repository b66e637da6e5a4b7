"""Which effects: single ones, pairs and triples, by signature and then in full."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.gap.core import fit
from bns.gap.core.fit import Point, Term
from bns.gap.core.null import Null
from bns.gap.core.problem import Problem
from bns.gap.core.signatures import Curves, integer
from bns.gap.core.whitening import loss, weights

SINGLES, NEAR = 10, 5  # single effects fitted in full: at most, and at least
PAIRS, TRIPLES = 5, 3
COARSE = 4.0  # loss per residual beyond which a third effect would not save it
STRUCTURE = 0.03  # p-value below which a rest has structure
SILENT = 0.3  # p-values above which there is no gap by far: fits stay rough
CHUNK = 256  # levels whose loss is taken at once


@dataclass(frozen=True, eq=False)
class Search:
    """Fitted supports by size, best first within each.

    Attributes:
        nothing: the empty support.
        sizes: points with one effect, with two, with three; later ones may be empty.
        screened: smallest loss on the signature of each candidate alone, ``(C,)``.
    """

    nothing: Point
    sizes: tuple[tuple[Point, ...], ...]
    screened: np.ndarray

    def best(self, size: int) -> Point | None:
        """The best support of a size, None if none was fitted."""
        if size == 0:
            return self.nothing
        found = self.sizes[size - 1] if size <= len(self.sizes) else ()
        return found[0] if found else None


def search(
    problem: Problem, curves: Curves, null: Null, *, worth: float, most: int = 3
) -> Search:
    """Fit what may explain a recording.

    Args:
        problem: the recording.
        curves: signatures.
        null: what chance gives.
        worth: improvement that a further effect has to bring.
        most: largest number of effects at once.
    """
    (nothing,) = fit.evaluate(problem, [()])
    losses = level_losses(curves, nothing.rest)
    screened = np.array(
        [min(losses[curves.levels(c)], default=np.inf) for c in range(_count(curves))]
    )
    silent = null.p_gain(nothing.loss - losses.min(initial=nothing.loss)) > SILENT
    silent = silent and null.misfit(problem, nothing.rest)[0] > SILENT
    singles = _singles(problem, curves, losses, screened, finish=not silent)
    sizes = [singles]
    if silent:
        return Search(nothing, tuple(sizes), screened)
    if most > 1 and _unexplained(problem, curves, null, singles[0], worth):
        sizes.append(_pairs(problem, curves, nothing, singles))
        best = sizes[1][0]
        more = most > 2 and singles[0].loss - best.loss > worth
        more = more and best.loss < COARSE * len(best.rest)
        if more and _unexplained(problem, curves, null, best, worth):
            sizes.append(_triples(problem, curves, sizes[1]))
    return Search(nothing, tuple(sizes), screened)


def _unexplained(
    problem: Problem, curves: Curves, null: Null, point: Point, worth: float
) -> bool:
    """Whether a further effect may help: the rest has structure."""
    if null.misfit(problem, point.rest)[0] < STRUCTURE:
        return True
    return point.loss - level_losses(curves, point.rest).min() > worth


def _count(curves: Curves) -> int:
    return len(curves.candidates)


def level_losses(curves: Curves, rest: np.ndarray) -> np.ndarray:
    """Loss if each level alone were added to the prediction, ``(L,)``."""
    rows, rest = curves.signature, rest.astype(np.float32)
    return np.concatenate(
        [loss(rest - rows[at : at + CHUNK]) for at in range(0, len(rows), CHUNK)]
        or [np.zeros(0)]
    )


def _starts(curves: Curves, losses: np.ndarray, candidate: int) -> list[Term]:
    """The best level, and the best on another branch if it is nearly as good."""
    mine = curves.levels(candidate)
    order = mine[np.argsort(losses[mine])]
    item = curves.candidates[candidate]
    first = order[0]
    made = [Term.at(item, int(curves.branch[first]), curves.magnitude[first])]
    others = order[curves.branch[order] != curves.branch[first]]
    if len(others) and losses[others[0]] < losses[first] + 0.2 * abs(losses[first]):
        made.append(
            Term.at(item, int(curves.branch[others[0]]), curves.magnitude[others[0]])
        )
    return made


def _singles(
    problem: Problem,
    curves: Curves,
    losses: np.ndarray,
    screened: np.ndarray,
    *,
    finish: bool,
) -> tuple[Point, ...]:
    order = np.argsort(screened)
    order = order[np.isfinite(screened[order])]
    limit = screened[order[0]] + max(60.0, 0.15 * (screened.max() - screened.min()))
    chosen = [c for place, c in enumerate(order) if place < NEAR or screened[c] < limit]
    starts = [
        [start]
        for candidate in chosen[:SINGLES]
        for start in _starts(curves, losses, candidate)
    ]
    return _unique(fit.refine_all(problem, starts, finish=finish))


def _pairs(
    problem: Problem,
    curves: Curves,
    nothing: Point,
    singles: Sequence[Point],
) -> tuple[Point, ...]:
    """The best pairs by superposed signatures, fitted in full."""
    table, at = pair_losses(curves, nothing.rest, weights(singles[0].rest))
    first, second = np.triu_indices(_count(curves), 1)
    order = np.argsort(table[first, second])
    added = _additions(curves, singles[0])[:2]
    starts = [[*singles[0].terms, term] for term in added]
    for a, b in zip(first[order[:PAIRS]], second[order[:PAIRS]], strict=True):
        if np.isfinite(table[a, b]):
            starts.append([_term(curves, level) for level in at[a, b]])
    return nested(_unique(fit.refine_all(problem, starts)), singles)


def _term(curves: Curves, level: int) -> Term:
    item = curves.candidates[curves.owner[level]]
    return Term.at(item, int(curves.branch[level]), curves.magnitude[level])


def _additions(curves: Curves, point: Point) -> list[Term]:
    """The best further effects, by their signatures alone."""
    losses = level_losses(curves, point.rest)
    found = []
    for candidate, item in enumerate(curves.candidates):
        mine = curves.levels(candidate)
        if item.name not in point.names and len(mine):
            found.append(mine[losses[mine].argmin()])
    found.sort(key=lambda level: losses[level])
    return [_term(curves, level) for level in found]


def _triples(
    problem: Problem, curves: Curves, pairs: Sequence[Point]
) -> tuple[Point, ...]:
    starts = [
        [*pair.terms, added]
        for pair in pairs[:2]
        for added in _additions(curves, pair)[: TRIPLES // 2]
    ]
    return nested(_unique(fit.refine_all(problem, starts)), pairs)


def nested(larger: Sequence[Point], smaller: Sequence[Point]) -> tuple[Point, ...]:
    """Supports none of which fits worse than one that it contains, best first.

    A fit that ended worse gets the magnitudes of the smaller one, what is added at its
    nominal value.
    """
    made = []
    for point in larger:
        inside = [s for s in smaller if set(s.names) < set(point.names)]
        best = min(inside, key=lambda found: found.loss, default=point)
        if best.loss < point.loss and len(best.slopes):
            added = [t for t in point.terms if t.candidate.name not in best.names]
            added = [replace(t, magnitude=t.candidate.nominal) for t in added]
            rows = sum(1 + len(term.extras) for term in added)
            empty = np.zeros((rows, len(best.rest)))
            point = replace(
                best,
                terms=(*best.terms, *added),
                slopes=np.concatenate([best.slopes, empty]),
            )
        made.append(point)
    return tuple(sorted(made, key=lambda found: found.loss))


def _unique(points: Sequence[Point]) -> tuple[Point, ...]:
    best: dict[frozenset, Point] = {}
    for point in sorted(points, key=lambda point: point.loss):
        if len(set(point.names)) == len(point.names):
            best.setdefault(frozenset(point.names), point)
    return tuple(best.values())


def pair_losses(
    curves: Curves, rest: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, dict[tuple[int, int], tuple[int, int]]]:
    """Smallest weighted square of the rest under any two levels.

    Args:
        curves: signatures.
        rest: whitened, ``(N,)``.
        weight: square roots of weights, ``(N,)``.

    Returns:
        ``(C, C)`` by pair of candidates, infinite on the diagonal; and their levels.
    """
    rows = curves.signature * weight.astype(np.float32)
    left = (rest * weight).astype(np.float32)
    own = (rows * rows).sum(axis=1) - 2 * rows @ left
    table = 2 * rows @ rows.T + own[:, None] + own[None, :]
    count = _count(curves)
    spans = [curves.levels(c) for c in range(count)]
    losses, at = np.full((count, count), np.inf), {}
    for a in range(count):
        if not len(spans[a]):
            continue
        band = table[spans[a][0] : spans[a][-1] + 1]
        for b in range(a + 1, count):
            if len(spans[b]):
                piece = band[:, spans[b][0] : spans[b][-1] + 1]
                row, column = np.unravel_index(piece.argmin(), piece.shape)
                losses[a, b] = float(left @ left) + piece[row, column]
                at[a, b] = int(spans[a][row]), int(spans[b][column])
    return losses, at


def held_out(
    problem: Problem, point: Point, *, folds: int = 5
) -> tuple[float, np.ndarray]:
    """Loss on trials that the magnitudes were not fitted to.

    The magnitudes are fitted again without each group of trials, along the slopes of
    the fit on all.

    Args:
        problem: the recording.
        point: a fitted support.
        folds: groups of trials.

    Returns:
        summed loss; loss by trial, ``(n_trials,)``.
    """
    rows = problem.whiten.rows
    by_trial = np.zeros(len(rows))
    groups = [range(k, len(rows), folds) for k in range(min(folds, len(rows)))]
    for group in groups:
        change = np.zeros(len(point.slopes))
        kept = np.ones(len(point.rest), dtype=bool)
        for number in group:
            kept[rows[number]] = False
        if len(point.slopes) and kept.any():
            weight = weights(point.rest[kept])
            slopes = point.slopes[:, kept] * weight
            change = np.linalg.lstsq(slopes.T, point.rest[kept] * weight, rcond=1e-8)[0]
        rest = point.rest - change @ point.slopes
        for number in group:
            by_trial[number] = loss(rest[rows[number]])
    return float(by_trial.sum()), by_trial


def evidence(point: Point) -> float:
    """Minus twice the log marginal likelihood, by Laplace, up to a constant.

    The prior of each magnitude is even over its range.
    """
    if not point.terms:
        return point.loss
    value = point.loss
    at = 0
    for term in point.terms:
        item = term.candidate
        curvature = float((point.slopes[at] ** 2).sum()) if len(point.slopes) else 0.0
        width = item.high - item.low
        if not integer(item) and curvature > 0:
            value += max(np.log(curvature * width**2 / (2 * np.pi)), 0.0)
        else:
            value += 2 * np.log(max(width, 2.0))
        at += 1 + len(term.extras)
    return float(value)
