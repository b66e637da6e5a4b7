"""One call from a recording to a verdict."""

import time
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from bns.errors import BnsError
from bns.gap.core import gap_closure, select, signatures, verdict, where
from bns.gap.core.fit import Point
from bns.gap.core.null import Null
from bns.gap.core.problem import Problem
from bns.gap.core.reference import Reference
from bns.gap.core.select import Search
from bns.gap.core.signatures import Curves
from bns.gap.core.uncertainty import intervals
from bns.gap.decomposition.diagnosis import diagnose as decomposed
from bns.gap.decomposition.model import BLOCK, FEW, DecomposableModel
from bns.gap.models.base import GapModel
from bns.gap.models.light import model as light_model
from bns.gap.recordings import check
from bns.gap.records import Candidate, Diagnosis, Fit, Verdict
from bns.worlds.trial import Trial

ALPHA_MORE = 0.01  # chance that a further effect is added where there is none
LISTED = 8  # fits of each size that are reported
LEAST = 2  # trials


class _Clock:
    def __init__(self):
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str):
        begin = time.perf_counter()
        yield
        spent = self.seconds.get(stage, 0.0) + time.perf_counter() - begin
        self.seconds[stage] = round(spent, 3)


def diagnose(
    trials: Sequence[Trial],
    model: GapModel,
    *,
    seed: int = 0,
    candidates: Sequence[Candidate] | None = None,
    calibration: verdict.Calibration | None = None,
    most: int = 3,
    full: bool = True,
    reference: Sequence[Trial] = (),
) -> Diagnosis:
    """Where a recording and a nominal model part, why, and how far it can be closed.

    Args:
        trials: recorded commands and observations.
        model: nominal model.
        seed: of what is drawn (null distributions, bootstraps).
        candidates: explanations to consider; None = all of the model's (or those
            that it suspects).
        calibration: thresholds, None = those of the package; the joint fit has none.
        most: largest number of effects at once; the joint fit has no limit.
        full: with localisation and closed fractions; False = the verdict alone.
        reference: recordings of the same robot in which nothing was changed; they tell
            how far the nominal model is off anyway (`gap/core/reference.py`).

    Raises:
        BnsError: too few trials, faults that cannot be repaired, channels that do not
            fit the model.
    """
    given = {
        "seed": seed,
        "candidates": candidates,
        "rules": calibration,
        "most": most,
        "reference": reference,
    }
    seen_by_light = light_model.told_by(model, (*trials, *reference))
    if isinstance(model, DecomposableModel) and not (reference or seen_by_light):
        usable, faults = _checked(trials, model)
        names = None if candidates is None else [item.name for item in candidates]
        return decomposed(
            usable, model, seed=seed, faults=faults, full=full, rows=names
        )
    if seen_by_light:
        from bns.gap.models.light import diagnosis

        parts = diagnosis.analyse(trials, model, **given)
        return diagnosis.report(*parts, full=full)
    return report(analyse(trials, model, **given), full=full)


@dataclass(frozen=True, eq=False)
class Analysis:
    """All that a diagnosis rests on, before it is written down.

    Attributes:
        problem, curves, null, search, choice, verdict: see there.
        faults: what `check` found.
        seed: of what was drawn.
        clock: seconds by stage.
        rules: thresholds.
    """

    problem: Problem
    curves: Curves
    null: Null
    search: Search
    choice: verdict.Choice
    verdict: Verdict
    faults: tuple[str, ...]
    seed: int
    clock: _Clock
    rules: verdict.Calibration

    @property
    def seen(self) -> float:
        """Whitened length of a signature that is found with 90 % power."""
        return self.null.seen


def analyse(
    trials: Sequence[Trial],
    model: GapModel,
    *,
    seed: int = 0,
    candidates: Sequence[Candidate] | None = None,
    rules: verdict.Calibration | None = None,
    most: int = 3,
    reference: Sequence[Trial] = (),
) -> Analysis:
    """From a recording to a verdict with all it rests on, see `diagnose`.

    Args:
        trials: recorded commands and observations.
        model: nominal model.
        seed: of what is drawn.
        candidates: explanations to consider; None = the model's, and of a model that
            suspects some these first.
        rules: thresholds, None = those of the package.
        most: largest number of effects at once.
        reference: recordings of the same robot in which nothing was changed.
    """
    clock = _Clock()
    with clock("check"):
        trials, faults = _checked(trials, model)
    given = {"seed": seed, "most": most, "reference": reference, "clock": clock}
    given |= {"faults": faults, "rules": rules or verdict.calibration()}
    if candidates is None and hasattr(model, "suspected"):
        made = _explained(trials, model, model.suspected(trials), **given)
        if made.verdict.kind != "none of the library":
            return made
        candidates = model.suspected(trials, everywhere=True)
    elif candidates is None:
        candidates = model.candidates()
    return _explained(trials, model, candidates, **given)


def _explained(
    trials: Sequence[Trial],
    model: GapModel,
    candidates: Sequence[Candidate],
    *,
    seed: int,
    most: int,
    reference: Sequence[Trial],
    clock: _Clock,
    faults: tuple[str, ...],
    rules: verdict.Calibration,
) -> Analysis:
    candidates = tuple(candidates)
    with clock("signatures"):
        if reference:
            usable, _ = check.check(reference, model)
            known = Reference.of(usable, model, candidates)
            problem = known.problem(trials, model)
        else:
            problem = Problem.of(trials, model, candidates=candidates)
        curves = signatures.trace(problem, candidates)
        null = Null.of(problem, curves, seed=seed)
    worth = null.threshold(ALPHA_MORE)
    with clock("fits"):
        search = select.search(problem, curves, null, worth=worth, most=most)
        choice = verdict.choose(problem, search, null, worth, rules)
        excite = {item.name: item.excite for item in candidates}
        answer = verdict.decide(problem, choice, rules, excite)
    return Analysis(
        problem, curves, null, search, choice, answer, faults, seed, clock, rules
    )


def report(made: Analysis, *, full: bool = True) -> Diagnosis:
    """An analysis written down.

    Args:
        made: the analysis.
        full: with localisation and closed fractions; False = the verdict alone.
    """
    problem, choice, clock = made.problem, made.choice, made.clock
    fits = _fits(problem, made.search, made.rules)
    where_found, closed = {}, {}
    if full:
        with clock("where"):
            where_found = where.where(problem, choice.best, seed=made.seed)
        with clock("closed"):
            closed = gap_closure.quantify(
                problem, made.null, made.search, choice.best, seed=made.seed
            )
    return Diagnosis(
        model=problem.model.name,
        trials=len(problem.trials),
        faults=made.faults,
        verdict=made.verdict,
        fits=fits,
        where=where_found,
        signatures=_signatures(made.curves, choice, made.seen),
        floor=_floor(problem),
        closed=closed,
        warnings=_warnings(problem, made.curves, fits, made.verdict),
        seed=made.seed,
        seconds=clock.seconds,
        partial={} if full else {"where, closed": "not asked for"},
    )


def _checked(
    trials: Sequence[Trial], model: GapModel
) -> tuple[tuple[Trial, ...], tuple[str, ...]]:
    trials, faults = check.check(trials, model)
    seconds = sum(trial.commands.duration for trial in trials)
    enough = isinstance(model, DecomposableModel) and seconds >= FEW * BLOCK
    if len(trials) < LEAST and not enough:
        raise BnsError(
            f"{len(trials)} usable trial: a diagnosis needs {LEAST} at least, to fit "
            "on some and test on others; record more."
        )
    return trials, faults


def _floor(problem: Problem) -> dict:
    floor = problem.floor
    return {
        "source": floor.source,
        "repeats": floor.repeats,
        "sigma": floor.sigma.tolist(),
        "process": floor.process.tolist(),
        "channels": [channel.name for channel in problem.model.channels],
    }


def _signatures(curves, choice, seen: float) -> dict:
    """Detectability of every candidate; angle of the chosen to each fitted rival."""
    best = choice.best
    ranked = [
        {"names": list(point.names), "score": score} for point, score in choice.ranked
    ]
    return {
        "seen": seen,
        "detectability": signatures.detectability(curves, seen),
        "ranked": ranked,
        "best": [str(term.effect()) for term in best.terms],
        "misfit_excess": choice.rung.excess,
        "explained": choice.rung.explained,
    }


def _fits(
    problem: Problem, search: Search, rules: verdict.Calibration
) -> tuple[Fit, ...]:
    points = [search.nothing]
    for found in search.sizes:
        points += found[:LISTED]
    base = select.held_out(problem, search.nothing)[1]
    return tuple(_fit(problem, point, base, rules) for point in points)


def _fit(
    problem: Problem, point: Point, base: np.ndarray, rules: verdict.Calibration
) -> Fit:
    held_out, by_trial = select.held_out(problem, point)
    spans, condition = intervals(problem, point, rules)
    improved = base - by_trial
    return Fit(
        names=point.names,
        effects=tuple(str(term.effect()) for term in point.terms),
        magnitudes=tuple(term.magnitude for term in point.terms),
        intervals=spans,
        units=tuple(term.candidate.unit for term in point.terms),
        loss=point.loss,
        held_out=held_out,
        held_out_se=float(improved.std(ddof=1) * np.sqrt(len(improved))),
        evidence=select.evidence(point),
        at_bound=tuple(t.candidate.name for t in point.terms if t.at_bound),
        condition=condition,
    )


def _warnings(problem: Problem, curves, fits: Sequence[Fit], answer) -> tuple[str, ...]:
    made = []
    if problem.floor.source != "repeats":
        made.append(
            "No repeats of the same commands: what the robot scatters by itself is "
            "assumed; record two or three repeats."
        )
    if curves.diverged:
        made.append(f"Diverged in simulation: {', '.join(curves.diverged)}.")
    chosen = answer.named[0] if answer.named else ()
    best = next((fit for fit in fits if chosen and fit.names == chosen), None)
    if best and best.at_bound:
        made.append(f"At a bound: {', '.join(best.at_bound)}.")
    if best and best.condition > 1e4:
        made.append(f"Magnitudes trade off (condition {best.condition:.0f}).")
    return tuple(made)
