"""The search for the set of explanations of highest evidence.

From all of them backward, from none forward, and from a given set, each improved by
adding, dropping and swapping (stepwise selection, by the evidence of whole sets rather
than of single steps). What was weighed on the way says how sure each explanation is.
"""

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

from bns.gap.decomposition.evidence.linear import Linear, Support

FEW = 12  # explanations of which each is dropped by way of trial on the way backward
TRIED = 3  # of more: those that look weakest
MERGED = 5  # explanations up to which two are tried against one


def best(
    linear: Linear,
    start: Iterable[str] | None = None,
    *,
    quick: bool = False,
    backward: bool = True,
) -> tuple[float, Support]:
    """The set of highest evidence: from all backward, from none forward and from a
    given one, each improved by adding, dropping and swapping.

    Args:
        linear: the model.
        start: a further set to start from.
        quick: from there alone, and without trying two against one.
        backward: from all as well; of hundreds that takes long and says little.

    Returns:
        its cost, and the set.
    """
    starts: list[Support] = [] if quick else [frozenset()]
    if backward and not quick:
        starts.insert(0, _backward(linear))
    if start is not None:
        starts.append(frozenset(start) & frozenset(linear.free))
    found = [_improved(linear, item, merge=not quick) for item in starts]
    return min(found, key=lambda item: item[0])


def _backward(linear: Linear) -> Support:
    kept = frozenset(linear.free)
    while kept:
        tried = kept if len(kept) <= FEW else _weakest(linear, kept)
        best = min((linear.cost(kept - {n}), n) for n in sorted(tried))
        if best[0] > linear.cost(kept):
            break
        kept -= {best[1]}
    return kept


def _weakest(linear: Linear, kept: Support) -> set[str]:
    """The explanations of a set that look as if they cost least to drop: by their
    evidence, for being beyond their bounds, or covered by others."""
    spread, paid = linear.spread(kept), linear.paid(kept)
    rising, beyond = {}, {}
    for name in kept:
        rows = list(linear.terms[name])
        now = spread.widened(rows, np.zeros(len(rows))).values
        beyond[name] = float(
            np.maximum(linear.low[rows] - now, now - linear.high[rows]).max()
        )
        value = spread.widened(rows, linear.slack[rows] ** 2 - 1.0).cost
        rising[name] = value + linear.paid(kept - {name}) - paid
    order = sorted(kept, key=lambda name: (rising[name], name))[:TRIED]
    far = [name for name in kept if beyond[name] > 0]
    far = sorted(far, key=lambda name: (-beyond[name], name))[:TRIED]
    covered = kept & frozenset().union(*linear.covers.values())
    return {*order, *far, *covered}


def _improved(linear: Linear, support: Support, merge: bool) -> tuple[float, Support]:
    """A set that no move makes better: one is added or dropped while that helps, then
    one swapped, then two merged, since there are many more of these to weigh."""
    best = linear.cost(support)
    better = True
    while better:
        better = False
        for moves in _moves(linear, support, merge):
            costs = [linear.cost(item) for item in moves]
            if costs and min(costs) < best - 1e-9:
                at = int(np.argmin(costs))
                best, support, better = costs[at], moves[at], True
                break
    return best, support


def _moves(linear: Linear, support: Support, merge: bool) -> Iterator[list[Support]]:
    inside, outside = sorted(support), [n for n in linear.free if n not in support]
    drops = [support - {name} for name in inside]
    yield drops + [support | {name} for name in outside]
    yield [(support - {name}) | {other} for name in inside for other in outside]
    if merge and len(support) <= MERGED:
        pairs = itertools.combinations(inside, 2)
        yield [(support - {*pair}) | {other} for pair in pairs for other in outside]


def _weigh(linear: Linear) -> None:
    if not linear.weighed:
        best(linear)


def near(linear: Linear, within: float) -> list[tuple[float, Support]]:
    """Sets that were weighed and cost no more than so much beyond the best."""
    _weigh(linear)
    least = min(linear.weighed.values())
    found = [(c - least, s) for s, c in linear.weighed.items() if c <= least + within]
    return sorted(found, key=lambda item: (item[0], sorted(item[1])))


def inclusion(linear: Linear, name: str) -> float:
    """Posterior probability of an explanation over all sets that were weighed."""
    _weigh(linear)
    costs = np.array(list(linear.weighed.values()))
    inside = np.array([name in support for support in linear.weighed])
    odds = np.exp(costs.min() - costs)
    return float(odds[inside].sum() / odds.sum())
