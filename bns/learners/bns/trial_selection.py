"""Which controller is tried in the world (thesis 2.8 step 1, 5.3.9)."""

from collections.abc import Callable

import torch
from torch import Tensor

from bns.draws import Draws
from bns.errors import UnknownNameError
from bns.evolution import selection
from bns.experiment.config import RunConfig
from bns.experiment.validate import check_choice


def choose(
    config: RunConfig,
    trial: int,
    cost: Tensor,
    draws: Draws,
    disagreement: Callable[[], Tensor],
) -> Tensor:
    """Index of one controller a run, ``(R,)``.

    tournament: the best of a random share `choose_tournament` of the population;
    best: the lowest predicted cost; random: any; best-worst-random: the three in turn,
    trial by trial (Parker 2000); disagreement: the one on which the ensemble's members
    differ most, among the better half (Bongard 2006 picks tests this way).

    Args:
        config: says how.
        trial: its number.
        cost: predicted, ``(R, P)``.
        draws: source of randomness.
        disagreement: gives how far an ensemble disagrees on each, ``(R, P)``.

    Raises:
        BnsError: disagreement without an ensemble.
        UnknownNameError: no such rule.
    """
    kind: str = config.choose
    if kind == "best-worst-random":
        kind = ("best", "worst", "random")[trial % 3]
    if kind == "best":
        return cost.argmin(1)
    if kind == "worst":
        return cost.argmax(1)
    if kind == "random":
        return selection.random(cost, draws.uniform(len(cost), 1, 1)).squeeze(1)
    if kind == "tournament":
        size = max(1, round(config.choose_tournament * cost.shape[1]))
        coins = draws.uniform(len(cost), 1, size)
        return selection.tournament(cost, coins).squeeze(1)
    if kind == "disagreement":
        check_choice(config)
        spread = disagreement()
        good = cost <= cost.median(1, keepdim=True).values
        return torch.where(good, spread, -1.0).argmax(1)
    known = ("best", "tournament", "random", "best-worst-random", "disagreement")
    raise UnknownNameError("choice", config.choose, known)
