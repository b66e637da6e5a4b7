"""In which regime the gap sits: a small regression tree, pruned on held-out trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bns.gap.where.compared import Compared, terms

DEPTH, CUTS = 2, 12  # splits in a row; thresholds tried per quantity
LEAST = 0.08  # share of windows in a leaf
GAIN = 0.05  # share of the held-out variance that the tree has to explain
CAP = 9.0  # mean energy of a window beyond which more does not count


@dataclass(frozen=True)
class Node:
    """A leaf, or a split at a threshold of one quantity."""

    mean: float
    share: float
    name: str = ""
    cut: float = 0.0
    below: "Node | None" = None
    above: "Node | None" = None


def regime(compared: Compared, *, seed: int = 0) -> dict[str, Any]:
    """The regime in words, empty if the gap is alike everywhere.

    Returns:
        words: where most of it sits; energy: mean whitened energy there and
        elsewhere; explained: held-out share of the variance.
    """
    columns: dict[str, list] = {}
    energy, owner = [], []
    for number, (trial, windows, gap) in enumerate(
        zip(compared.trials, compared.windows, compared.gap, strict=True)
    ):
        for name, value in compared.model.regime(trial, windows).items():
            columns.setdefault(name, []).append(value)
        energy.append(np.minimum(terms(gap).mean(axis=1), CAP))
        owner.append(np.full(len(windows), number))
    table = {name: np.concatenate(value) for name, value in columns.items()}
    if not table:
        return {}
    target, owners = np.concatenate(energy), np.concatenate(owner)
    held_out = owners % 3 == seed % 3
    if held_out.all() or not held_out.any():
        return {}
    tree = grow({k: v[~held_out] for k, v in table.items()}, target[~held_out], DEPTH)
    test = {name: value[held_out] for name, value in table.items()}
    truth = target[held_out]
    explained = 1 - ((truth - predict(tree, test)) ** 2).mean() / max(
        truth.var(), 1e-12
    )
    if explained < GAIN or not tree.name:
        return {"explained": float(explained)}
    words, mean = worst(tree)
    rest = (target.mean() - mean[0] * mean[1]) / max(1 - mean[1], 1e-9)
    return {
        "words": " and ".join(words),
        "energy": [float(mean[0]), float(max(rest, 0.0))],
        "share": float(mean[1]),
        "explained": float(explained),
    }


def grow(
    table: Mapping[str, np.ndarray], target: np.ndarray, depth: int, share: float = 1.0
) -> Node:
    """The tree that lowers the squared error most at every split.

    Args:
        table: what may split, by name, each ``(W,)``.
        target: what is explained, ``(W,)``.
        depth: number of splits that may follow one another.
        share: of all windows that these are; 1 at the root.
    """
    leaf = Node(float(target.mean()), share)
    least = max(int(LEAST * len(target) / share), 10)
    if depth == 0 or len(target) < 2 * least:
        return leaf
    best = (0.0, "", 0.0)
    for name, value in table.items():
        cuts = np.unique(np.quantile(value, np.linspace(0.05, 0.95, CUTS)))
        if value.min() < 0 < value.max():
            cuts = np.append(cuts, 0.0)
        for cut in cuts:
            above = value > cut
            count = int(above.sum())
            if min(count, len(value) - count) < least:
                continue
            apart = target[above].mean() - target[~above].mean()
            gain = apart**2 * count * (len(value) - count) / len(value)
            if gain > best[0]:
                best = (gain, name, float(cut))
    if not best[1]:
        return leaf
    _, name, cut = best
    sides = []
    for chosen in (table[name] <= cut, table[name] > cut):
        part = {key: value[chosen] for key, value in table.items()}
        sides.append(grow(part, target[chosen], depth - 1, share * chosen.mean()))
    return Node(leaf.mean, share, name, cut, *sides)


def predict(tree: Node, table: Mapping[str, np.ndarray]) -> np.ndarray:
    """Mean of the leaf that each window falls into, ``(W,)``."""
    width = len(next(iter(table.values())))
    if tree.below is None or tree.above is None:
        return np.full(width, tree.mean)
    above = table[tree.name] > tree.cut
    return np.where(above, predict(tree.above, table), predict(tree.below, table))


def worst(tree: Node) -> tuple[list[str], Sequence[float]]:
    """The leaf with the largest mean: conditions in words, (mean, share)."""
    if tree.below is None or tree.above is None:
        return [], (tree.mean, tree.share)
    options = []
    for node, side in ((tree.below, "at most"), (tree.above, "above")):
        words, found = worst(node)
        options.append((found[0], [_words(tree.name, side, tree.cut), *words], found))
    _, words, found = max(options, key=lambda option: option[0])
    return words, found


def _words(name: str, side: str, cut: float) -> str:
    name, _, unit = name.partition(" [")
    if abs(cut) < 1e-9:
        return f"{name} is {'negative or zero' if side == 'at most' else 'positive'}"
    return f"{name} is {side} {cut:.3g} {unit.rstrip(']')}".rstrip()
