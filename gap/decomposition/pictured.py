"""Where a gap sits and its size in plain units, beside a decomposition."""

from typing import Any

from bns.gap.where import horizons, localised
from bns.gap.where.compared import Compared


def where(made: Any, *, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Localisation of the gap, and its size over a second before and after.

    Args:
        made: a decomposition.
        seed: of the bootstraps.
    """
    problem = made.problem
    compared = Compared.of(problem.trials, problem.model, made.floor.sigma)
    effects = [
        effect
        for part in made.parts
        if (effect := problem.model.effect(part.name, part.values)) is not None
    ]
    found = localised.where(compared, effects, seed=seed)
    return found, horizons.plain_gap(compared, effects)
