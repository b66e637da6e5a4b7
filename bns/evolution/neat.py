"""NEAT (Stanley and Miikkulainen 2002): topologies and weights evolve together.

All numbers are those of the paper, but for the population's size. Where it is silent:
a child may grow and have its weights changed at once, weights are limited (without,
they grow until all sigmoids are saturated), and of two parents that do equally well the
smaller one gives the structure. Genomes are arrays, see `bns.evolution.topology`.

Written by hand because neat-python 2.0 draws from Python's global `random` and keeps
its state by pickle.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from bns.evolution.topology import (
    ENABLED,
    INNOVATION,
    WEIGHT,
    Ends,
    Marks,
    add_connection,
    add_node,
    matches,
)
from bns.experiment.config import LearnerSettings

SMALL = 20
"""genomes with fewer genes than this differ by numbers of genes, larger by shares"""


@dataclass(frozen=True, kw_only=True)
class NeatSettings(LearnerSettings):
    """Settings of NEAT; section 4.1 of Stanley and Miikkulainen 2002."""

    population: int = 100
    """networks; 150 in the paper"""
    generations: int = 20
    """generations between two trials in the world"""
    most: int = 60
    """connections of a network at most (own)"""
    power: float = 2.5
    """weights are drawn and perturbed uniformly by up to this"""
    limit: float = 8.0
    """weights stay between - and + this (silent in the paper)"""
    threshold: float = 3.0
    """networks that differ by no more share a species"""
    structure: float = 1.0
    """what a gene counts that only one of two networks has (c1 and c2)"""
    weights: float = 0.4
    """what the mean difference of the weights of the others counts (c3)"""
    stale: int = 0
    """a species that has not improved for so many generations has no children; 0 =
    never: generations that are judged from other starts do not compare; 15 in the
    paper"""
    stuck: int = 0
    """if nothing has improved for more generations, two species have children; 0 =
    never; 20 in the paper"""
    champions: int = 5
    """the best of a species with more networks than this lives on unchanged"""
    survivors: float = 0.2
    """share of a species that may have children (silent in the paper)"""
    mutated_only: float = 0.25
    """share of children with one parent"""
    between: float = 0.001
    """chance that the other parent is of any species"""
    disabled: float = 0.75
    """chance that a gene is off in a child if it is in a parent"""
    weights_mutated: float = 0.8
    """chance that a child's weights change"""
    perturbed: float = 0.9
    """then a weight is perturbed with this chance, else drawn anew"""
    add_node: float = 0.03
    """chance that a connection is split by a new node"""
    add_connection: float = 0.05
    """chance that two nodes are connected"""

    bounds: ClassVar[dict[str, tuple[float, float, str]]] = {
        "population": (2, 100_000, "networks"),
        "generations": (0, 100_000, "generations"),
        "most": (4, 1000, "connections"),
        "power": (0, 1000, "1"),
        "limit": (0, 1000, "1"),
        "threshold": (0, 1000, "1"),
        "structure": (0, 1000, "1"),
        "weights": (0, 1000, "1"),
        "stale": (0, 100_000, "generations"),
        "stuck": (0, 100_000, "generations"),
        "champions": (0, 100_000, "networks"),
        "survivors": (0, 1, "1"),
        "mutated_only": (0, 1, "1"),
        "between": (0, 1, "1"),
        "disabled": (0, 1, "1"),
        "weights_mutated": (0, 1, "1"),
        "perturbed": (0, 1, "1"),
        "add_node": (0, 1, "1"),
        "add_connection": (0, 1, "1"),
    }


@dataclass
class Species:
    """Networks that are alike.

    Attributes:
        like: the one that others are compared with, ``(C, 5)``.
        members: rows of the population.
        best: highest worth so far.
        stale: generations since.
    """

    like: np.ndarray
    members: np.ndarray
    best: float = -np.inf
    stale: int = 0


@dataclass
class Lineage:
    """What a population remembers from one generation to the next.

    Attributes:
        species: in the order in which they came up.
        best: highest worth so far.
        stale: generations since.
    """

    species: list[Species] = field(default_factory=list)
    best: float = -np.inf
    stale: int = 0

    def sort(self, genes: np.ndarray, rule: NeatSettings) -> None:
        """Put each network into the first species that it is like, or a new one.

        Args:
            genes: ``(P, C, 5)``.
            rule: how much networks of a species may differ.
        """
        free = np.ones(len(genes), bool)
        for each in self.species:
            free = self._join(each, genes, free, rule)
        while free.any():
            each = Species(genes[free.argmax()], np.empty(0, int))
            free = self._join(each, genes, free, rule)
            self.species.append(each)
        self.species = [each for each in self.species if len(each.members)]

    @staticmethod
    def _join(
        each: Species, genes: np.ndarray, free: np.ndarray, rule: NeatSettings
    ) -> np.ndarray:
        """Take the networks that are like a species; who is free still, ``(P,)``."""
        rows = np.flatnonzero(free)
        apart = distance(genes[rows], each.like, rule)
        each.members = rows[apart <= rule.threshold]
        free[each.members] = False
        return free

    def note(self, worth: np.ndarray) -> None:
        """Who has improved, by what each network is worth, ``(P,)``."""
        now = float(worth.max())
        self.stale = 0 if now > self.best else self.stale + 1
        self.best = max(self.best, now)
        for each in self.species:
            now = float(worth[each.members].max())
            each.stale = 0 if now > each.best else each.stale + 1
            each.best = max(each.best, now)

    def breeding(self, rule: NeatSettings, worth: np.ndarray) -> list[Species]:
        """The species that may have children, the one with the best network first.

        Args:
            rule: when a species is stale.
            worth: of each network, ``(P,)``.
        """
        order = sorted(self.species, key=lambda s: -float(worth[s.members].max()))
        if 0 < rule.stuck < self.stale:
            self.stale = 0
            for each in order[:2]:
                each.stale = 0
            return order[:2]
        limit = rule.stale or np.inf
        return [s for s in order if s is order[0] or s.stale < limit]


def distance(genes: np.ndarray, other: np.ndarray, rule: NeatSettings) -> np.ndarray:
    """How much networks differ from another one: equation 1 of the paper.

    Args:
        genes: ``(P, C, 5)``.
        other: ``(C, 5)``.
        rule: what differences count.

    Returns:
        ``(P,)``.
    """
    same, at = matches(genes, np.broadcast_to(other, genes.shape))
    apart = np.abs(genes[..., WEIGHT] - other[:, WEIGHT][at]) * same
    shared = same.sum(1)
    mine, its = (genes[..., INNOVATION] > 0).sum(1), (other[:, INNOVATION] > 0).sum()
    size = np.maximum(mine, its)
    size = np.where(size < SMALL, 1, size)
    unlike = (mine + its - 2 * shared) / size
    mean = apart.sum(1) / np.maximum(shared, 1)
    found: np.ndarray = rule.structure * unlike + rule.weights * mean
    return found


def bred(
    genes: np.ndarray,
    worth: np.ndarray,
    lineage: Lineage,
    marks: Marks,
    ends: Ends,
    rule: NeatSettings,
    rng: np.random.Generator,
) -> np.ndarray:
    """The next generation.

    Args:
        genes: of the population, ``(P, C, 5)``.
        worth: higher is better, above 0, ``(P,)``.
        lineage: of the population; goes on.
        marks: numbers of inventions; go on.
        ends: of the networks.
        rule: rates.
        rng: the only source of randomness.

    Returns:
        ``(P, C, 5)``.
    """
    lineage.sort(genes, rule)
    lineage.note(worth)
    parents = lineage.breeding(rule, worth)
    one, other, kept = _parents(parents, worth, rule, rng)
    children = crossed(genes, worth, one, other, rule, rng)
    children[kept] = genes[one[kept]]
    _mutate(children, ~kept, marks, ends, rule, rng)
    for each in lineage.species:
        each.like = genes[rng.choice(each.members)]
    return children


def _parents(
    species: list[Species],
    worth: np.ndarray,
    rule: NeatSettings,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the parents of all children, and who is a champion unchanged."""
    means = np.array([worth[each.members].mean() for each in species])
    able = [
        each.members[np.argsort(-worth[each.members], kind="stable")][
            : max(1, int(np.ceil(rule.survivors * len(each.members))))
        ]
        for each in species
    ]
    pool, one, other, kept = np.concatenate(able), [], [], []
    shares = shared_out(means, len(worth))
    for each, rows, count in zip(species, able, shares, strict=True):
        first, second = rng.choice(rows, (2, count))
        any_row = rng.choice(pool, count)
        second = np.where(rng.random(count) < rule.between, any_row, second)
        second = np.where(rng.random(count) < rule.mutated_only, first, second)
        stays = np.zeros(count, bool)
        if count and len(each.members) > rule.champions:
            first[0], stays[0] = rows[0], True
        one.append(first)
        other.append(second)
        kept.append(stays)
    return np.concatenate(one), np.concatenate(other), np.concatenate(kept)


def shared_out(means: np.ndarray, count: int) -> np.ndarray:
    """Children of each species, as its mean worth is of all, ``(S,)``; sums to count.

    The worth of a network over the size of its species, summed over the species, is
    the species' mean worth (explicit fitness sharing).
    """
    wanted = means / means.sum() * count
    found = np.floor(wanted).astype(int)
    rest = np.argsort(found - wanted, kind="stable")[: count - found.sum()]
    found[rest] += 1
    return found


def crossed(
    genes: np.ndarray,
    worth: np.ndarray,
    one: np.ndarray,
    other: np.ndarray,
    rule: NeatSettings,
    rng: np.random.Generator,
) -> np.ndarray:
    """Children of two parents each; of one parent with itself it is a copy.

    The better one's genes, or the smaller one's where both do as well; of those that
    both have, either's.

    Args:
        genes: of the population, ``(P, C, 5)``.
        worth: of it, ``(P,)``.
        one, other: rows of the parents, ``(N,)``.
        rule: rates.
        rng: the only source of randomness.
    """
    size = (genes[..., INNOVATION] > 0).sum(1)
    tie = (worth[other] == worth[one]) & (size[other] < size[one])
    swap = (worth[other] > worth[one]) | tie
    better = genes[np.where(swap, other, one)].copy()
    worse = genes[np.where(swap, one, other)]
    same, at = matches(better, worse)
    theirs = np.take_along_axis(worse, at[..., None], 1)
    coins = rng.random((2, *same.shape))
    taken = same & (coins[0] < 0.5)
    mine = better[..., ENABLED] > 0
    on = mine & (~same | (theirs[..., ENABLED] > 0))
    better[..., WEIGHT] = np.where(taken, theirs[..., WEIGHT], better[..., WEIGHT])
    both = (one != other)[:, None] & (better[..., INNOVATION] > 0)
    better[..., ENABLED] = np.where(both, on | (coins[1] >= rule.disabled), mine)
    return better


def _mutate(
    genes: np.ndarray,
    which: np.ndarray,
    marks: Marks,
    ends: Ends,
    rule: NeatSettings,
    rng: np.random.Generator,
) -> None:
    """Change the genomes ``(P, C, 5)`` marked in `which` ``(P,)``, in place."""
    marks.new_generation()
    coins = rng.random((3, len(genes)))
    node = which & (coins[0] < rule.add_node)
    link = which & (coins[1] < rule.add_connection)
    weights = which & (coins[2] < rule.weights_mutated)
    for row in np.flatnonzero(node):
        add_node(genes[row], marks, rng)
    for row in np.flatnonzero(link):
        add_connection(genes[row], marks, ends, rule.power, rng)
    drawn = rng.uniform(-rule.power, rule.power, genes.shape[:2])
    kept = rng.random(drawn.shape) < rule.perturbed
    changed = np.where(kept, genes[..., WEIGHT], 0) + drawn
    changed = changed.clip(-rule.limit, rule.limit)
    real = weights[:, None] & (genes[..., INNOVATION] > 0)
    genes[..., WEIGHT] = np.where(real, changed, genes[..., WEIGHT])
