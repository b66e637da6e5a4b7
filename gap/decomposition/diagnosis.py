"""From a recording to a diagnosis by the joint fit."""

import time
from collections.abc import Sequence
from dataclasses import replace

from bns.gap.decomposition.decomposition import LARGE, Decomposition, decompose
from bns.gap.decomposition.descent import NUMEROUS
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.record import recorded
from bns.gap.decomposition.starts import FEW
from bns.gap.models.base import GapModel
from bns.gap.records import Diagnosis
from bns.progress import Tell, unheard
from bns.worlds.trial import Trial

LEAST = 0.005  # of a gap, left: less is not worth another search
HALF = 0.5  # of what is left: what is clearly less
SMALL = 0.01  # of the gap: an explanation that closes less does not count


def diagnose(
    trials: Sequence[Trial],
    model: GapModel,
    *,
    seed: int = 0,
    faults: Sequence[str] = (),
    full: bool = True,
    rows: Sequence[str] | None = None,
    tell: Tell = unheard,
) -> Diagnosis:
    """A diagnosis of a checked recording.

    Args:
        trials: checked recording.
        model: nominal model.
        seed: of what is drawn.
        faults: what the check found.
        full: with localisation; False = the verdict alone.
        rows: names of the explanations that are considered, None = all.
        tell: is told when a stage begins.
    """
    began = time.perf_counter()
    problem = Problem.of(trials, model)
    if rows is not None:
        problem = narrowed(problem, rows)
    made = decompose(problem, seed=seed, tell=tell)
    if rows is None:
        made = widened(made, seed=seed, tell=tell)
    seconds = {"fit": round(time.perf_counter() - began, 3)}
    return recorded(made, faults=faults, seed=seed, seconds=seconds, full=full)


def narrowed(problem: Problem, names: Sequence[str]) -> Problem:
    """A problem with some explanations alone; nuisances stay."""
    kept = tuple(
        row for row in problem.rows if row.nuisance or {row.name, row.term} & set(names)
    )
    return replace(problem, rows=kept)


def widened(
    made: Decomposition, *, seed: int = 0, tell: Tell = unheard
) -> Decomposition:
    """A decomposition beside the one with what a robot's description does not list,
    searched where what it lists leaves much, and not what repeats scatter, and kept
    where it leaves less than half of that: by no more explanations, or by one further,
    of which those do not count that close a trifle.

    Args:
        made: the decomposition by what is listed.
        seed: of what is drawn.
        tell: is told when that search begins.
    """
    much = made.lasting or made.failing or made.after > LARGE
    if not much or made.unexplained < LEAST or made.kind == "no gap":
        return made
    model = made.problem.model.unlisted()
    if model is None:
        return made
    problem = Problem.of(made.problem.trials, model)
    if len(problem.terms) > NUMEROUS:
        return made
    tell("what [effects] does not list")
    other = decompose(problem, seed=seed)
    better = explains_more(made, other)
    return replace(made, searched=True, unlisted=other if better else None)


def explains_more(made: Decomposition, other: Decomposition) -> bool:
    """Whether a decomposition with what is not listed is to be told, see `widened`."""
    named, found = made.point.support, other.point.support
    if other.foreign or found <= made.problem.terms.keys():
        return False
    most = len(named) + (named <= found) if named else FEW
    count = sum(part.last >= SMALL for part in other.parts)
    return count <= most and other.after < HALF * made.after
