"""Which candidates a recording cannot tell from an effect."""

from dataclasses import dataclass, replace

import numpy as np

from bns.gap.core import fit, signatures
from bns.gap.core.problem import Problem
from bns.gap.core.signatures import Curves

# A pair of signatures d noise units apart is confused with probability Phi(-d / 2);
# 20 % is reached at d = 1.68.
ALIKE = 1.68
TRIED = 4  # candidates nearest by their curves that are fitted to be sure
NEAR = 4.0 * ALIKE, 0.4  # farther than that, and than a share of the effect: not fitted


@dataclass(frozen=True)
class Likeness:
    """How near a candidate comes to an effect, its magnitude free.

    Attributes:
        name: of the candidate.
        distance: whitened, of the two motions.
        angle: between their whitened signatures [deg].
    """

    name: str
    distance: float
    angle: float

    @property
    def alike(self) -> bool:
        """Whether one recording would confuse the two in a fifth of the cases."""
        return self.distance < ALIKE


def likeness(problem: Problem, curves: Curves, term: fit.Term) -> tuple[Likeness, ...]:
    """The candidates nearest to an effect, fitted to what it alone would do.

    Args:
        problem: a recording; its commands and its noise count.
        curves: its signatures.
        term: the effect.

    Returns:
        the nearest first, the effect itself left out.
    """
    (shown,) = problem.signatures([[term.effect()]])
    gaps, nearest = signatures.nearest(curves, shown)
    reach = max(NEAR[0], NEAR[1] * float(np.linalg.norm(shown)))
    order = [c for c in np.argsort(gaps) if gaps[c] < reach**2][: TRIED + 1]
    levels = [nearest[candidate] for candidate in order]
    starts = [
        fit.Term.at(
            curves.candidates[curves.owner[level]],
            int(curves.branch[level]),
            float(curves.magnitude[level]),
        )
        for level in levels
    ]
    starts += [  # curves with steps do not show that two are the same at one magnitude
        replace(term, candidate=item)
        for item in curves.candidates
        if item.effect == term.candidate.effect and item != term.candidate
        if item.parameter == term.candidate.parameter
    ]
    starts = [start for start in starts if start.candidate != term.candidate]
    (predicted,) = problem.model.simulate(problem.trials, [[term.effect()]])
    motion = tuple(
        map(problem.model.compare, problem.trials, predicted, problem.windows)
    )
    clean = replace(problem, recorded=motion)
    best: dict[str, Likeness] = {}
    for point in fit.refine_all(clean, [[start] for start in starts]):
        angle = signatures.angle(clean.rest, clean.rest - point.rest)
        (name,) = point.names
        made = Likeness(name, float(np.linalg.norm(point.rest)), angle)
        if name not in best or made.distance < best[name].distance:
            best[name] = made
    return tuple(sorted(best.values(), key=lambda item: item.distance))


def accepted(term: fit.Term, found: tuple[Likeness, ...]) -> tuple[str, ...]:
    """The candidates that may be named for an effect, itself included, sorted."""
    return tuple(sorted({term.candidate.name, *(o.name for o in found if o.alike)}))
