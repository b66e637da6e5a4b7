"""Networks of any topology as rows of genes, for NEAT.

A genome is up to C genes, ``(C, 5)``, each a connection between two nodes; a row whose
innovation is 0 is no gene. Nodes are numbered: inputs, the bias, outputs, then hidden
ones as they come. Networks feed forward only, connections that are off included.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

INNOVATION, SOURCE, TARGET, WEIGHT, ENABLED = range(5)
KINDS = 5

SLOPE = 4.9
"""of the sigmoid 1 / (1 + exp(-4.9 x)) of every node"""
TRIES = 20
"""pairs of nodes drawn to find one that can be connected"""


@dataclass(frozen=True)
class Ends:
    """Inputs and outputs of the networks.

    Attributes:
        inputs: without the bias, I.
        outputs: O.
    """

    inputs: int
    outputs: int

    @property
    def fixed(self) -> int:
        """Nodes that every network has; hidden ones are numbered from here on."""
        return self.inputs + 1 + self.outputs

    @property
    def links(self) -> int:
        """Genes of a first network, in which inputs and bias drive all outputs."""
        return (self.inputs + 1) * self.outputs

    def first(self, weights: np.ndarray, most: int) -> np.ndarray:
        """First networks, fully connected and without hidden nodes.

        Args:
            weights: ``(..., links)``.
            most: genes that a genome has room for, C.

        Returns:
            ``(..., C, 5)`` float32.
        """
        genes = np.zeros((*weights.shape[:-1], most, KINDS), np.float32)
        own, count = genes[..., : self.links, :], np.arange(self.links)
        own[..., INNOVATION] = 1 + count
        own[..., SOURCE] = count // self.outputs
        own[..., TARGET] = self.inputs + 1 + count % self.outputs
        own[..., WEIGHT] = weights
        own[..., ENABLED] = 1
        return genes


@dataclass
class Marks:
    """Historical markings of a run: the same invention of a generation has one number.

    Attributes:
        innovation, node: the next new numbers.
        links: connections invented in this generation, by their nodes.
        splits: nodes invented in it, by the innovation that was split: the node, and
            the innovations into it and out of it.
    """

    innovation: int
    node: int
    links: dict[tuple[int, int], int] = field(default_factory=dict)
    splits: dict[int, tuple[int, int, int]] = field(default_factory=dict)

    @classmethod
    def of(cls, ends: Ends) -> "Marks":
        """Those of a first population."""
        return cls(1 + ends.links, ends.fixed)

    def new_generation(self) -> None:
        """Forget what was invented; the numbers go on."""
        self.links, self.splits = {}, {}

    def link(self, source: int, target: int) -> int:
        """The innovation of a connection."""
        if (source, target) not in self.links:
            self.links[source, target] = self.innovation
            self.innovation += 1
        return self.links[source, target]

    def split(self, innovation: int) -> tuple[int, int, int]:
        """The node that splits a connection, and the innovations around it."""
        if innovation not in self.splits:
            first = self.innovation
            self.splits[innovation] = (self.node, first, first + 1)
            self.node, self.innovation = self.node + 1, first + 2
        return self.splits[innovation]


def matches(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Genes that two networks have in common, by their innovations.

    Args:
        one, other: ``(N, C, 5)``.

    Returns:
        Whether the other has each gene of the one, ``(N, C)``, and at which row.
    """
    mine, its = one[..., INNOVATION], other[..., INNOVATION]
    same = (mine[:, :, None] == its[:, None, :]) & (mine > 0)[:, :, None]
    return same.any(2), same.argmax(2)


def add_node(genome: np.ndarray, marks: Marks, rng: np.random.Generator) -> None:
    """Split a connection by a new node, in place; nothing where there is no room.

    The way into the node weighs 1, the way out what the connection did.

    Args:
        genome: ``(C, 5)``.
        marks: numbers of inventions.
        rng: the only source of randomness.
    """
    size = int((genome[:, INNOVATION] > 0).sum())
    able = np.flatnonzero(genome[:, ENABLED] > 0)
    if size + 2 > len(genome) or not len(able):
        return
    gene = genome[rng.choice(able)]
    node, into, out = marks.split(int(gene[INNOVATION]))
    gene[ENABLED] = 0
    genome[size] = into, gene[SOURCE], node, 1, 1
    genome[size + 1] = out, node, gene[TARGET], gene[WEIGHT], 1


def add_connection(
    genome: np.ndarray,
    marks: Marks,
    ends: Ends,
    power: float,
    rng: np.random.Generator,
) -> None:
    """Connect two nodes that are not, forward only, in place.

    Nothing where there is no room or no such pair is drawn.

    Args:
        genome: ``(C, 5)``.
        marks: numbers of inventions.
        ends: of the network.
        power: largest weight.
        rng: the only source of randomness.
    """
    size = int((genome[:, INNOVATION] > 0).sum())
    if size + 1 > len(genome):
        return
    pairs = genome[:size, [SOURCE, TARGET]].astype(int).tolist()
    hidden = sorted({node for pair in pairs for node in pair if node >= ends.fixed})
    sources = [*range(ends.inputs + 1), *hidden]
    targets = [*range(ends.inputs + 1, ends.fixed), *hidden]
    for _ in range(TRIES):
        source, target = int(rng.choice(sources)), int(rng.choice(targets))
        if [source, target] in pairs or source in reached(target, pairs):
            continue
        weight = rng.uniform(-power, power)
        genome[size] = marks.link(source, target), source, target, weight, 1
        return


def reached(node: int, pairs: list[list[int]]) -> set[int]:
    """Nodes to which connections lead from a node, itself one of them."""
    found, new = {node}, [node]
    while new:
        at = new.pop()
        after = {target for source, target in pairs if source == at} - found
        found |= after
        new.extend(after)
    return found


def networks(genes: np.ndarray, ends: Ends) -> tuple[np.ndarray, np.ndarray, int]:
    """Genomes as matrices that drive outputs and hidden nodes, outputs first.

    Args:
        genes: ``(N, C, 5)``.
        ends: of the networks.

    Returns:
        weights from these nodes ``(N, M, M)`` and from inputs and bias
        ``(N, M, I + 1)``, target first; and how often the former have to be applied
        until all that is put in has come out.
    """
    count, free = len(genes), ends.inputs + 1
    nodes = genes[..., [SOURCE, TARGET]].reshape(count, -1).astype(int)
    nodes = np.concatenate([np.full((count, 1), ends.fixed - 1), nodes], axis=1)
    order = nodes.clip(ends.fixed - 1).argsort(1, kind="stable")
    new = np.diff(np.take_along_axis(nodes.clip(ends.fixed - 1), order, 1), axis=1) > 0
    rank = np.zeros_like(nodes)
    steps = np.concatenate([np.zeros((count, 1), int), new.cumsum(1)], axis=1)
    np.put_along_axis(rank, order, steps, 1)
    packed = np.where(nodes < ends.fixed, nodes, ends.fixed - 1 + rank)[:, 1:]
    source, target = np.moveaxis(packed.reshape(count, -1, 2), -1, 0)
    size = ends.outputs + int(rank.max(initial=0))
    weights = np.zeros((count, size, free + size), np.float32)
    row, place = np.nonzero(genes[..., ENABLED] > 0)
    at = row, target[row, place] - free, source[row, place]
    weights[at] = genes[row, place, WEIGHT]
    inner = weights[..., free:]
    return inner, weights[..., :free], depth(inner)


def depth(weights: np.ndarray) -> int:
    """Longest way through acyclic networks ``(N, M, M)``, in connections."""
    linked = weights != 0
    driven, steps = linked.any(2), 0
    while driven.any():
        driven, steps = (linked & driven[:, None, :]).any(2), steps + 1
    return steps


def sizes(genes: np.ndarray, ends: Ends) -> Iterator[tuple[int, int]]:
    """Hidden nodes and connections that are on, of each genome ``(N, C, 5)``."""
    for genome in genes:
        nodes = np.unique(genome[:, [SOURCE, TARGET]])
        yield int((nodes >= ends.fixed).sum()), int((genome[:, ENABLED] > 0).sum())
