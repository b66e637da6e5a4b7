"""Blind cases of a walking robot: recordings with a hidden effect, answers apart."""

import numpy as np

from bns.gap.bench import walk_cases
from bns.gap.bench.cases import Answer, Case
from bns.gap.core import signatures
from bns.gap.core.aliases import accepted, likeness
from bns.gap.core.null import Null
from bns.gap.core.problem import Problem
from bns.gap.core.support import Term
from bns.gap.models.legged.model import WalkModel
from bns.worlds.trial import Trial

KINDS = ("single", "lost", "none")


def build(seed: int, kind: str, model: WalkModel) -> Case:
    """Make a case.

    Args:
        seed: of everything in it.
        kind: "single"; "lost" (a leg that is raised, limp or gone, a joint that is
            locked); or "none".
        model: nominal model.

    Raises:
        BnsError: no effect that could be hidden lets the robot stand.
    """
    case = walk_cases.build(seed, kind, model)
    nominal = tuple(str(effect) for effect in case.nominal)
    answer = Answer(kind, nominal=nominal)
    if case.term is not None:
        answer = _answer(kind, case.trials, case.term, nominal, model)
    told = tuple(trial.commands for trial in case.trials)
    return Case(case.trials, answer, case.nominal, told)


def _answer(
    kind: str,
    trials: tuple[Trial, ...],
    term: Term,
    nominal: tuple[str, ...],
    model: WalkModel,
) -> Answer:
    listed = model.suspected(trials, everywhere=True)
    problem = Problem.of(trials, model, candidates=listed)
    curves = signatures.trace(problem, listed)
    seen = Null.of(problem, curves).seen
    (shown,) = problem.signatures([[term.effect()]])
    alike = accepted(term, likeness(problem, curves, term))
    return Answer(
        kind,
        names=(term.candidate.name,),
        effects=(str(term.effect()),),
        magnitudes=(term.magnitude,),
        sizes=(float(np.linalg.norm(shown)) / seen,),
        aliases=(tuple(sorted({*alike, *term.candidate.aliases})),),
        nominal=nominal,
        detected=seen,
    )
