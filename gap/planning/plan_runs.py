"""How often to run which commands, so that what is tied comes apart."""

import numpy as np
from scipy.stats import norm

from bns.gap.decomposition.ties import TIED

MOST, POWER = 10, 1.2816  # runs that may be asked for; standard normal: 90 % power


def repeats(distance: float, *, tie: float | None = None) -> int:
    """How often a command has to be run to part two explanations in 9 of 10 cases.

    Args:
        distance: whitened, of one run.
        tie: difference of losses up to which two explanations count as tied.

    Returns:
        from 1 on; 0 if `MOST` runs are not enough.
    """
    for count in range(1, MOST + 1):
        if parts(distance * np.sqrt(count), tie=tie):
            return count
    return 0


def parts(distance: float, *, tie: float | None = None) -> bool:
    """Whether recordings that far apart decide between two explanations, 9 of 10 times.

    Args:
        distance: whitened, of all runs together.
        tie: difference of losses up to which two explanations count as tied.
    """
    tie = 4 * TIED if tie is None else tie
    return bool(distance**2 - 2 * POWER * distance >= tie)


def runs(table: np.ndarray) -> dict[int, int]:
    """Options by number and how often to run each, so that all pairs come apart.

    The fewest runs of one command or two, of one if that does; of as many those that
    least likely name the wrong one. Where `MOST` runs do not part all pairs, the fewest
    that part most.

    Args:
        table: whitened distances by option and pair, ``(O, P)``.
    """
    squares = table**2
    most, counts = 0, {0: 1}
    for total in range(1, MOST + 1):
        surest = -np.inf
        for first in range(total, (total - 1) // 2, -1):
            both = first * squares[:, None] + (total - first) * squares[None, :]
            parted, sure, one, two = _best(both, alone=first == total)
            if parted > most or (parted == most and sure > surest > -np.inf):
                counts = {one: first}
                if first < total:
                    counts[two] = total - first
                most, surest = parted, sure
            if first == total and parted == table.shape[1]:
                return counts
        if most == table.shape[1]:
            break
    return counts


def _best(squares: np.ndarray, *, alone: bool) -> tuple[int, float, int, int]:
    """Pairs parted, how surely, and the numbers of the two commands that do it.

    Args:
        squares: of distances by first option, second option and pair, ``(O, O, P)``.
        alone: the second one is not run.
    """
    if alone:
        squares = squares[:, :1]
    distances = np.sqrt(squares)
    parted = (distances >= _needed() * (1 - 1e-9)).sum(axis=2)
    wrong = norm.sf(distances / 2).sum(axis=2)
    order = np.lexsort([wrong.ravel(), -parted.ravel()])[0]
    one, two = np.unravel_index(order, parted.shape)
    return int(parted[one, two]), -float(wrong[one, two]), int(one), int(two)


def _needed() -> float:
    """Distance from which recordings decide, see `parts`."""
    return POWER + float(np.sqrt(POWER**2 + 4 * TIED))
