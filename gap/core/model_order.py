"""How many effects a recording calls for: rungs of one, two, three of them."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from bns.gap.core.fit import Point
from bns.gap.core.null import Null, spread
from bns.gap.core.problem import Problem
from bns.gap.core.select import Search, held_out

Names = tuple[str, ...]
BEYOND = 4.0  # times what chance hardly exceeds: beyond that nothing is left to confirm


class Rules(Protocol):
    """What is needed of a calibration."""

    more: float
    minor: float


@dataclass(frozen=True)
class Rung:
    """The best support of a size and its rivals, as plain data.

    Attributes:
        size: number of effects; 0 = nothing.
        loss: of the best support.
        held_out: its loss on each trial, fitted on others.
        scores: names and score of each support of the size, best first; a score is
            how much larger its loss is, in units of what the rest scatters.
        p_misfit, excess: see `Null.misfit`, of what the best support leaves.
        explained: by how much the best support's loss is smaller than nothing's.
    """

    size: int
    loss: float
    held_out: tuple[float, ...]
    scores: tuple[tuple[Names, float], ...]
    p_misfit: float
    excess: float
    explained: float

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> "Rung":
        """From what `as_dict` gave, also by way of JSON."""
        scores = tuple((tuple(names), score) for names, score in content["scores"])
        return cls(
            **{**content, "scores": scores, "held_out": tuple(content["held_out"])}
        )


def rungs(problem: Problem, search: Search, null: Null) -> tuple[Rung, ...]:
    """All sizes for which a support was fitted, nothing first.

    Args:
        problem: the recording.
        search: supports that were fitted, by size.
        null: what is left is tested against it.
    """
    found = [(search.nothing,), *search.sizes]
    return tuple(
        _rung(size, points, search.nothing, problem, null)
        for size, points in enumerate(found)
        if points
    )


def _rung(
    size: int, points: Sequence[Point], nothing: Point, problem: Problem, null: Null
) -> Rung:
    best = points[0]
    scale = max(1.0, spread(best.rest)) ** 2
    p_misfit, excess = null.misfit(problem, best.rest)
    return Rung(
        size=size,
        loss=float(best.loss),
        held_out=tuple(held_out(problem, best)[1].tolist()),
        scores=tuple((p.names, float((p.loss - best.loss) / scale)) for p in points),
        p_misfit=p_misfit,
        excess=excess,
        explained=float(nothing.loss - best.loss),
    )


def climb(found: Sequence[Rung], worth: float, rules: Rules) -> Rung:
    """The rung that a recording calls for.

    A first effect has to improve the loss by more than chance does. A further one has
    to improve it by more than `Rules.more` and by more than the share `Rules.minor` of
    all that is explained then: a nominal model that is a little wrong always leaves
    something; two at once by twice as much. All have to improve the loss on trials that
    they were not fitted to by more than one standard error; a first effect that
    explains `BEYOND` times what chance does need not, since it may be felt in one trial
    alone.

    Args:
        found: rungs, nothing first.
        worth: improvement by one effect that chance hardly exceeds.
        rules: thresholds.
    """
    now = found[0]
    for new in found[1:]:
        if now.size:
            least = max(worth, rules.more, rules.minor * new.explained)
        else:
            least = worth
        least *= new.size - now.size
        gains = np.subtract(now.held_out, new.held_out)
        error = float(gains.std(ddof=1) * np.sqrt(len(gains)))
        clear = new.size == 1 and now.loss - new.loss > BEYOND * worth
        confirmed = clear or gains.sum() > min(error, least)
        if now.loss - new.loss > least and confirmed:
            now = new
    return now
