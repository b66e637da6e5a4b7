"""Which candidates a recording cannot tell from an effect."""

from dataclasses import replace

from bns.gap import fit, signatures
from bns.gap.problem import Problem
from bns.gap.signatures import Curves

# A pair of signatures d noise units apart is confused with probability Phi(-d / 2);
# 20 % is reached at d = 1.68.
ALIKE = 1.68**2
DOUBTFUL = 2.0  # times that, by the curves alone, a candidate is fitted to be sure


def alike(problem: Problem, curves: Curves, term: fit.Term) -> tuple[str, ...]:
    """Candidates that a recording of this kind cannot tell from an effect."""
    (shown,) = problem.signatures([[term.effect()]])
    gaps, nearest = signatures.nearest(curves, shown)
    starts = [
        fit.Term.at(
            curves.candidates[curves.owner[level]],
            int(curves.branch[level]),
            float(curves.magnitude[level]),
        )
        for gap, level in zip(gaps, nearest, strict=True)
        if gap < DOUBTFUL * ALIKE
    ]
    starts += [  # curves with steps do not show that two are the same at one magnitude
        replace(term, candidate=item)
        for item in curves.candidates
        if item.effect == term.candidate.effect and item != term.candidate
        if item.parameter == term.candidate.parameter
    ]
    (predicted,) = problem.model.simulate(problem.trials, [[term.effect()]])
    motion = tuple(
        map(problem.model.compare, problem.trials, predicted, problem.windows)
    )
    clean = replace(problem, recorded=motion)
    found = fit.refine_all(clean, [[start] for start in starts])
    near = [point.names[0] for point in found if point.loss < ALIKE]
    return tuple(sorted({term.candidate.name, *near}))
