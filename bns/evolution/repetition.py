"""Lists of commands that repeat themselves, as gaits do: an operator of our own.

A list that goes round a few commands meets the same few motions again and again: a
trial teaches the SNNs them well, and what they foresee of such a list is less wrong
than of one whose commands all differ.
"""

import torch
from torch import Tensor

from bns.draws import whole_below

PERIODS = (2, 3, 4)  # commands of a round
COINS = 6  # uniform numbers that a child takes


def repeated(genes: Tensor, coins: Tensor, chance: Tensor) -> Tensor:
    """Children of which some repeat their own commands.

    With `chance` one command is copied to another place, and with `chance` the
    commands go round from some place on, in one of `PERIODS`.

    Args:
        genes: ``(R, N, K, C)``.
        coins: uniform numbers, ``(R, N, COINS)``.
        chance: of each run, ``(R,)``.
    """
    chance = chance[:, None, None]
    count = genes.shape[2]
    copies, source, target, rounds, begin, period = coins.unsqueeze(-1).unbind(-2)
    place = torch.arange(count, device=genes.device).expand(*genes.shape[:2], -1)
    hit = (copies < chance) & (place == whole_below(target, count))
    copied = torch.where(hit, whole_below(source, count), place)
    first = whole_below(begin, max(count - PERIODS[-1], 1))
    length = PERIODS[0] + whole_below(period, len(PERIODS))
    after = (rounds < chance) & (place >= first)
    turned = torch.where(after, first + (place - first) % length, place)
    index = copied.gather(2, turned)
    return genes.gather(2, index.unsqueeze(-1).expand_as(genes))
