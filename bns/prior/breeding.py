"""Breeding vectors in the unit cube, for one goal or for several at once.

A generation of one goal: tournaments of `TOURNAMENT`, one-point crossover (vectors are
lists of commands, joint by joint or one after another), a normal step on a few genes,
and the best of parents and children survive. The numbers are the best of those tried on
navigation with 2,500 evaluations. For several goals NSGA-II (Deb et al. 2002) says who
survives.
"""

import numpy as np

TOURNAMENT = 3
CROSSED = 0.5
"""share of children with two parents"""
STEP, CHANGED = 0.2, 0.05
"""standard deviation of a step, as a share of a gene's range; share of genes changed"""


def bred(genes: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Children of a population.

    Args:
        genes: each from 0 to 1, the best individual first, ``(P, D)``.
        count: of children, N.
        rng: the only source of randomness.

    Returns:
        ``(N, D)``, each from 0 to 1.
    """
    size, length = genes.shape
    one, other = rng.integers(size, size=(2, count, TOURNAMENT)).min(axis=2)
    cut = rng.integers(1, length + 1, (count, 1))
    cut = np.where(rng.random((count, 1)) < CROSSED, cut, length)
    children = np.where(np.arange(length) < cut, genes[one], genes[other])
    changed = rng.random(children.shape) < CHANGED
    steps = STEP * rng.standard_normal(children.shape)
    return inside(np.where(changed, children + steps, children))


def inside(genes: np.ndarray) -> np.ndarray:
    """Genes that left the unit cube, reflected at its sides; shape like theirs."""
    found: np.ndarray = 1.0 - np.abs(1.0 - genes % 2.0)
    return found


def ranked(costs: np.ndarray) -> np.ndarray:
    """Rows in the order in which NSGA-II keeps them, ``(N,)``.

    By front; within one, those with more room around them first.

    Args:
        costs: of several goals, all lower is better, ``(N, G)``.
    """
    order: list[np.ndarray] = []
    for front in fronts(costs):
        room = crowding(costs[front])
        order.append(front[np.argsort(-room, kind="stable")])
    return np.concatenate(order) if order else np.empty(0, np.int64)


def fronts(costs: np.ndarray) -> list[np.ndarray]:
    """Rows that nothing dominates, those that only these dominate, and so on.

    Args:
        costs: of several goals, all lower is better, ``(N, G)``.
    """
    no_worse = (costs[:, None] <= costs[None]).all(2)
    better = np.asarray(no_worse & (costs[:, None] < costs[None]).any(2))
    left, found = np.ones(len(costs), bool), []
    while left.any():
        front = np.flatnonzero(left & ~better[left].any(0))
        found.append(front)
        left[front] = False
    return found


def crowding(costs: np.ndarray) -> np.ndarray:
    """Room around each member of a front, ``(N,)``; infinite at its ends.

    Args:
        costs: of several goals, ``(N, G)``.
    """
    room = np.zeros(len(costs))
    for values in costs.T:
        order = np.argsort(values, kind="stable")
        width = values[order[-1]] - values[order[0]]
        if width > 0:
            room[order[1:-1]] += (values[order[2:]] - values[order[:-2]]) / width
            room[order[[0, -1]]] = np.inf
    return room
