"""Where a gap sits and its size in plain units, beside a decomposition."""

from typing import Any

import numpy as np

from bns.gap.core import where as core_where
from bns.gap.core.fit import Point
from bns.gap.core.gap_closure import plain_gap
from bns.gap.core.problem import Problem


def where(made: Any, *, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Localisation of the gap, and its size over a second before and after.

    Args:
        made: a decomposition.
        seed: of the bootstraps.
    """
    decomposed = made.problem
    problem = Problem.of(decomposed.trials, decomposed.model)
    effects = [
        effect
        for part in made.parts
        if (effect := decomposed.model.effect(part.name, part.values)) is not None
    ]
    (left,) = problem.rests([effects])
    point = Point((), left, float((left**2).sum()), np.zeros((0, len(left))))
    found = core_where.where(problem, point, seed=seed)
    found["change"] = {}
    return found, plain_gap(problem, effects)
