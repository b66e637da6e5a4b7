"""Crossover of lists and mutation of genes (thesis 2.3.7, 2.3.8), batched over runs.

Parents are two `Population`s of the same shape; each pair makes one child that begins
like the first. Cuts fall between commands and are drawn *independently* in the two
parents, so that the child's length differs from both: with a shared cut or a fixed
length the navigation task was never solved (see docs/choices.md).

Every mutation changes each gene with probability `rate` and keeps it inside the
encoding's bounds. One uniform number a gene decides both: below `rate` the gene
mutates, and the number divided by `rate` is uniform again.
"""

import torch
from torch import Tensor

from bns.draws import whole_below
from bns.errors import UnknownNameError
from bns.evolution.chromosome import Population

KINDS = ("n-point", "sbx", "single-point", "uniform")


def n_point(
    first: Population, second: Population, cuts_first: Tensor, cuts_second: Tensor
) -> Population:
    """Alternate segments of two parents, cut at given points.

    Args:
        first, second: parents, genes ``(R, N, K, 3)``.
        cuts_first: sorted cut points in the first parents' lists, ``(R, N, n)``.
        cuts_second: the same in the second parents', ``(R, N, n)``.

    Returns:
        Children: segment 0 of the first parent, segment 1 of the second, and so on;
        cut off at K commands, a childless pair (length 0) copies the first parent.
    """
    longest = first.genes.shape[2]
    place = torch.arange(longest, device=first.genes.device)
    parents = torch.cat([first.genes, second.genes], dim=2)
    source = torch.zeros_like(first.genes[..., 0], dtype=torch.long)
    filled = torch.zeros_like(first.lengths)
    count = cuts_first.shape[-1]
    for segment in range(count + 1):
        own = segment % 2 == 0
        cuts = cuts_first if own else cuts_second
        ends = first.lengths if own else second.lengths
        start = cuts[..., segment - 1] if segment else torch.zeros_like(ends)
        stop = cuts[..., segment] if segment < count else ends
        taken = stop - start
        shift = (start - filled + (0 if own else longest)).unsqueeze(-1)
        inside = (place >= filled.unsqueeze(-1)) & (
            place < (filled + taken).unsqueeze(-1)
        )
        source = torch.where(inside, place + shift, source)
        filled = filled + taken
    empty = filled == 0
    source = torch.where(empty.unsqueeze(-1), place, source)
    lengths = torch.where(empty, first.lengths, filled.clamp(max=longest))
    genes = parents.gather(2, source.unsqueeze(-1).expand(-1, -1, -1, parents.shape[3]))
    child = Population(genes, lengths)
    return child._replace(genes=genes * child.valid.unsqueeze(-1))


def uniform(first: Population, second: Population, coins: Tensor) -> Population:
    """Each gene from either parent with equal chance, where both have one.

    Args:
        first, second: parents.
        coins: uniform numbers, ``(R, N, K, 3)``.

    Returns:
        Children of the first parents' lengths.
    """
    both = (first.valid & second.valid).unsqueeze(-1)
    swap = both & (coins < 0.5)
    return first._replace(genes=torch.where(swap, second.genes, first.genes))


def simulated_binary(
    first: Population, second: Population, coins: Tensor, eta: float
) -> Population:
    """Simulated binary crossover (eqs 2.15-2.17), where both parents have a gene.

    Args:
        first, second: parents.
        coins: v_j of eq 2.17, uniform, ``(R, N, K, 3)``.
        eta: distribution index.
    """
    power = 1.0 / (eta + 1.0)
    spread = torch.where(
        coins <= 0.5, (2 * coins) ** power, (0.5 / (1 - coins)) ** power
    )
    mixed = 0.5 * ((1 + spread) * first.genes + (1 - spread) * second.genes)
    both = (first.valid & second.valid).unsqueeze(-1)
    return first._replace(genes=torch.where(both, mixed, first.genes))


def coins_needed(kind: str, points: int, genes_shape: tuple[int, ...]) -> tuple:
    """Shape of the uniform numbers that `cross` takes for N pairs, ``(R, N, ...)``.

    Args:
        kind: operator, one of `KINDS`.
        points: cuts in each parent, where the operator is "n-point".
        genes_shape: of the children's genes, ``(R, N, K, 3)``.

    Raises:
        UnknownNameError: no such operator.
    """
    if kind not in KINDS:
        raise UnknownNameError("crossover", kind, KINDS)
    runs, pairs = genes_shape[:2]
    if kind == "single-point":
        return runs, pairs, 2
    if kind == "n-point":
        return runs, pairs, 2 * points
    return genes_shape


def cross(
    kind: str,
    first: Population,
    second: Population,
    coins: Tensor,
    *,
    eta: float = 1.0,
    fixed_length: bool = False,
) -> Population:
    """Crossover by name.

    Args:
        kind: operator.
        first, second: parents.
        coins: uniform numbers of the shape `coins_needed` gives.
        eta: distribution index of sbx.
        fixed_length: both parents are cut at the same places.

    Raises:
        UnknownNameError: no such operator.
    """
    if kind in ("single-point", "n-point"):
        mine, theirs = coins.chunk(2, dim=-1)
        cuts_first = whole_below(mine, first.lengths.unsqueeze(-1) + 1).sort(-1).values
        limit = second.lengths.unsqueeze(-1) + 1
        cuts_second = whole_below(theirs, limit).sort(-1).values
        if fixed_length:
            cuts_second = cuts_first
        return n_point(first, second, cuts_first, cuts_second)
    if kind == "uniform":
        return uniform(first, second, coins)
    if kind == "sbx":
        return simulated_binary(first, second, coins, eta)
    raise UnknownNameError("crossover", kind, KINDS)


def bounded_uniform(share: Tensor, genes: Tensor, magnitude: Tensor) -> Tensor:
    """Eq 2.19: add a number uniform in -magnitude..magnitude.

    Args:
        share: uniform numbers, as `genes`.
        genes: ``(R, P, K, 3)``.
        magnitude: per run and gene kind, broadcasting to `genes`.
    """
    return genes + (2 * share - 1) * magnitude


def uniform_range(share: Tensor, genes: Tensor, low: Tensor, high: Tensor) -> Tensor:
    """Eq 2.18: with equal chance go uniformly towards the upper or lower bound.

    Args:
        share: uniform numbers, as `genes`.
        genes: ``(R, P, K, 3)``.
        low, high: gene bounds, ``(3,)``.
    """
    up = share < 0.5
    part = torch.where(up, 2 * share, 2 * share - 1)
    return torch.where(up, genes + part * (high - genes), genes - part * (genes - low))


def gaussian(share: Tensor, genes: Tensor, magnitude: Tensor) -> Tensor:
    """Eq 2.20: add a normal number of standard deviation `magnitude`."""
    return genes + normal(share) * magnitude


def normal(share: Tensor) -> Tensor:
    """Standard normal numbers from uniform ones."""
    inside = share.clamp(1e-6, 1 - 1e-6)
    return torch.erfinv(2 * inside - 1) * 2**0.5


def mutate(
    kind: str,
    genes: Tensor,
    coins: Tensor,
    rate: Tensor,
    magnitude: Tensor,
    low: Tensor,
    high: Tensor,
) -> Tensor:
    """Mutation by name.

    Args:
        kind: operator.
        genes: ``(R, P, K, 3)``.
        coins: uniform numbers, as `genes`.
        rate: mutation probability, ``(R,)``.
        magnitude: per run and gene kind, ``(R, 3)``, units of the genes.
        low, high: gene bounds, ``(3,)``.

    Raises:
        UnknownNameError: no such operator.
    """
    chance = rate[:, None, None, None]
    size = magnitude[:, None, None, :]
    share = (coins / chance).clamp(max=1.0)
    if kind == "bounded-uniform":
        changed = bounded_uniform(share, genes, size)
    elif kind == "uniform-range":
        changed = uniform_range(share, genes, low, high)
    elif kind == "gaussian":
        changed = gaussian(share, genes, size)
    else:
        known = ("bounded-uniform", "uniform-range", "gaussian")
        raise UnknownNameError("mutation", kind, known)
    changed = torch.minimum(torch.maximum(changed, low), high)
    return torch.where(coins < chance, changed, genes)
