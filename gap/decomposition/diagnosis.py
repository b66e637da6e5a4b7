"""From a recording to a diagnosis by the joint fit."""

import time
from collections.abc import Sequence
from dataclasses import replace

from bns.gap.decomposition.decomposition import decompose
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.record import recorded
from bns.gap.models.base import GapModel
from bns.gap.records import Diagnosis
from bns.progress import Tell, unheard
from bns.worlds.trial import Trial


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
    seconds = {"fit": round(time.perf_counter() - began, 3)}
    return recorded(made, faults=faults, seed=seed, seconds=seconds, full=full)


def narrowed(problem: Problem, names: Sequence[str]) -> Problem:
    """A problem with some explanations alone; nuisances stay."""
    kept = tuple(
        row for row in problem.rows if row.nuisance or {row.name, row.term} & set(names)
    )
    return replace(problem, rows=kept)
