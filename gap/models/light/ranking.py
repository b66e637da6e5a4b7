"""The order of explanations of readings, by their likelihood, and whether any will do.

Of the explanations that come near by the search's own measure each is weighed again
(`light_weighing`), and the best is asked whether readings scatter about it as they
should: what the library lacks may leave no structure in time or place.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from bns.gap.core.model_order import Rung
from bns.gap.core.support import Point, evaluate
from bns.gap.core.verdict import Choice, decide
from bns.gap.diagnose import Analysis
from bns.gap.models.light.weighing import Readings, Weight
from bns.gap.records import Verdict

RIVALS, NEAR = 10, 60.0  # explanations weighed: at most, and how much worse at most
MEDIAN = 0.4549  # of the square of a normal number


def weighed(made: Analysis) -> Analysis:
    """An analysis of readings, its explanations in the order of their likelihood.

    Whether the best leaves readings that scatter more than they should is looked at
    as well: an effect that the library lacks may have no structure in time or place.
    """
    rung = made.choice.rung
    if not rung.size or made.verdict.kind == "no gap":
        return made
    readings = Readings(made.problem)
    points = made.search.sizes[rung.size - 1]
    near = [p for p in points[:RIVALS] if p.loss < points[0].loss + NEAR]
    if rung.size > 1:
        near = near[:1]
    found = [(readings.weigh(point.terms), point) for point in near]
    found.sort(key=lambda pair: pair[0].deviance)
    made = _again(made, found, [p for p in points if p not in near])
    return _claimed(made, readings.weigh(()).deviance - found[0][0].deviance)


def _claimed(made: Analysis, gain: float) -> Analysis:
    """The analysis with the gap only where the likelihood shows it as well.

    Args:
        made: the analysis.
        gain: what the best explanation improves the deviance by.
    """
    chance = min(made.null.p_gain(gain), made.choice.rungs[0].p_misfit)
    choice = replace(made.choice, p_gap=min(1.0, 2 * chance))
    return replace(made, choice=choice, verdict=_decided(made, choice))


def _decided(made: Analysis, choice: Choice) -> Verdict:
    excite = {item.name: item.excite for item in made.curves.candidates}
    return decide(made.problem, choice, made.rules, excite)


def _again(
    made: Analysis, found: list[tuple[Weight, Point]], others: Sequence[Point]
) -> Analysis:
    choice, first = made.choice, found[0][0]
    scale = max(1.0, float(np.median(first.rest**2)) / MEDIAN)
    terms = [weight.terms for weight, _ in found]
    points = [
        replace(at, slopes=point.slopes)
        for at, (_, point) in zip(evaluate(made.problem, terms), found, strict=True)
    ]
    scores = [(weight.deviance - first.deviance) / scale for weight, _ in found]
    least = min(point.loss for _, point in found)
    points += others
    scores += [max(NEAR, point.loss - least) for point in others]
    rung = _rung(choice.rung, first, points, scores)
    chosen = replace(
        choice,
        rungs=tuple(rung if old is choice.rung else old for old in choice.rungs),
        rung=rung,
        best=points[0],
        ranked=tuple(zip(points, scores, strict=True)),
    )
    sizes = list(made.search.sizes)
    sizes[rung.size - 1] = tuple(points)
    search = replace(made.search, sizes=tuple(sizes))
    return replace(made, search=search, choice=chosen)


def _rung(
    old: Rung, first: Weight, points: Sequence[Point], scores: Sequence[float]
) -> Rung:
    """The rung with new scores, and with what scatters too much as structure."""
    count, ratio = len(first.rest), first.scatter
    p_scatter = float(norm.sf((ratio - 1) * np.sqrt(count / 2)))
    names = [point.names for point in points]
    return replace(
        old,
        scores=tuple(zip(names, scores, strict=True)),
        p_misfit=min(1.0, 2 * min(old.p_misfit, p_scatter)),
        excess=max(old.excess, (ratio - 1) * count),
    )
