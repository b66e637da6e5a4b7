"""From fits to one answer, never surer than the recording allows."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from bns.gap.core import residual_report
from bns.gap.core.fit import Point
from bns.gap.core.gap_closure import flexible
from bns.gap.core.model_order import Rung, climb, rungs
from bns.gap.core.null import Null, lasting, spread
from bns.gap.core.problem import Problem
from bns.gap.core.select import Search
from bns.gap.core.signatures import angle
from bns.gap.core.whitening import loss
from bns.gap.records import Verdict
from bns.gap.report.verdict_words import change, sentence


@dataclass(frozen=True)
class Calibration:
    """Thresholds of the verdict, found on cases made for it (`bench`).

    Attributes:
        alpha_gap: p-value below which there is a gap.
        alpha_misfit: p-value below which the best support leaves structure.
        misfit_share: what the rest still hides, as a share of what was explained, for
            the answer to be "none of the library".
        tie: how much larger the loss of a support may be for it to stay in the 90 %
            set; the conformal quantile of `scores`.
        sure: the same for it to be named beside the best one; larger, since a name
            that stands alone has to be right more often than the set covers.
        more, minor: by how much a further effect has to improve the loss, at least,
            and as a share of all that is explained with it.
        model_error: how far the nominal model alone puts a magnitude off, as a share
            of its departure from nominal (one standard deviation, assumed).
        widen: factor on the intervals of magnitudes with which they hold the truth as
            often as `coverage` says.
        coverage: of the sets and the intervals.
        scores: loss of the true support over the best one's, per calibration case.
    """

    alpha_gap: float = 0.02
    alpha_misfit: float = 0.01
    misfit_share: float = 0.02
    tie: float = 6.0
    sure: float = 6.0
    more: float = 14.0
    minor: float = 0.015
    model_error: float = 0.01
    widen: float = 1.0
    coverage: float = 0.9
    scores: tuple[float, ...] = ()


@cache
def calibration() -> Calibration:
    """The calibration that comes with the package."""
    text = (files(__package__) / "calibration.json").read_text(encoding="utf-8")
    content = json.loads(text)
    return Calibration(**{**content, "scores": tuple(content["scores"])})


def quantile(scores: Sequence[float], coverage: float) -> float:
    """Conformal threshold: at least this share of new scores lies below it."""
    ordered = np.sort(np.asarray(scores, dtype=float))
    place = int(np.ceil(coverage * (len(ordered) + 1))) - 1
    return float(ordered[min(place, len(ordered) - 1)])


@dataclass(frozen=True, eq=False)
class Choice:
    """The supports that a verdict weighs.

    Attributes:
        rungs: of each size, nothing first.
        rung: the one that the recording calls for.
        best: its best support.
        ranked: all fitted supports of that size with their scores, best first.
        p_gap: probability of so large a gap if there were none.
        worth: improvement by one effect that chance hardly exceeds.
        left: what a flexible model, fitted on other trials, still improves on the best
            support, and the standard error of that over trials.
    """

    rungs: tuple[Rung, ...]
    rung: Rung
    best: Point
    ranked: tuple[tuple[Point, float], ...]
    p_gap: float
    worth: float
    left: tuple[float, float]


def choose(
    problem: Problem, search: Search, null: Null, worth: float, rules: Calibration
) -> Choice:
    """How many effects, and the supports of that size in order.

    Args:
        problem: the recording.
        search: what was fitted.
        null: what chance gives.
        worth: improvement by one effect that chance hardly exceeds.
        rules: thresholds.
    """
    found = rungs(problem, search, null)
    p_gap = chance(problem, search, null, found)
    rung = climb(found, worth, rules)
    points = search.sizes[rung.size - 1] if rung.size else (search.nothing,)
    scores = [score for _, score in rung.scores]
    left = _left(problem, null, points[0])
    ranked = tuple(zip(points, scores, strict=True))
    return Choice(found, rung, points[0], ranked, p_gap, worth, left)


def chance(
    problem: Problem, search: Search, null: Null, found: Sequence[Rung]
) -> float:
    """Probability of so large a gap if there were none.

    A recording speaks against "none" by what one effect improves and by the structure
    that is there without any. It does not where the best effect is one that the nominal
    model is unsure of, no farther off than it may be, and leaves no structure: where
    signatures turn as effects grow, a whitener lets such an effect pass in proportion
    alone.

    Args:
        problem: the recording.
        search: what was fitted.
        null: what chance gives.
        found: rungs, nothing first.
    """
    nothing, single = search.nothing, search.best(1)
    gain = nothing.loss - min(single.loss, nothing.loss)
    gain /= max(1.0, spread(single.rest)) ** 2  # noise that is larger than was thought
    gain /= lasting(problem, single.rest)
    none = min(null.p_gain(gain), found[0].p_misfit)
    (term,) = single.terms
    unsure = min(term.believed, found[1].p_misfit)
    return min(1.0, 2 * max(none, unsure))


def _left(problem: Problem, null: Null, best: Point) -> tuple[float, float]:
    rows = problem.whiten.rows
    gain = [loss(best.rest[own]) for own in rows] - flexible(problem, null, best.rest)
    return float(gain.sum()), float(gain.std(ddof=1) * np.sqrt(len(gain)))


def decide(
    problem: Problem, choice: Choice, calibration: Calibration, excite: dict[str, str]
) -> Verdict:
    """The verdict.

    Args:
        problem: the recording.
        choice: what was fitted.
        calibration: thresholds.
        excite: by candidate, which commands make it felt.
    """
    kind, named, sets = judge(choice.rung, choice.p_gap, calibration)
    tied = [point for point, score in choice.ranked if score <= calibration.sure]
    rivals = [(p, s) for p, s in choice.ranked if s > calibration.sure]
    second, margin = (rivals[0][0].names, rivals[0][1]) if rivals else ((), np.inf)
    between = _angle(problem, tied) if kind == "either" else 90.0
    p_gap, p_misfit = choice.p_gap, choice.rung.p_misfit
    words = sentence(kind, choice.best, tied, between, p_gap, p_misfit)
    if kind != "no gap" and choice.rung.size and p_misfit < calibration.alpha_misfit:
        words += " " + residual_report.text(problem, choice.best, choice.rung)
    return Verdict(
        kind=kind,
        named=named,
        sets=sets,
        angle=between,
        p_gap=p_gap,
        p_misfit=p_misfit,
        second=second,
        margin=float(margin),
        sentence=words,
        change=change(kind, choice.best, tied, second, float(margin), excite),
    )


def judge(
    rung: Rung, p_gap: float, rules: Calibration
) -> tuple[str, tuple[tuple[str, ...], ...], tuple[tuple[str, ...], ...]]:
    """Kind, named supports and the 90 % set, see `Verdict`.

    Args:
        rung: the chosen size.
        p_gap: probability of so large a gap if there were none.
        rules: thresholds.
    """
    sets = tuple(names for names, score in rung.scores if score <= rules.tie)
    near = tuple(names for names, score in rung.scores if score <= rules.sure)
    if p_gap > rules.alpha_gap and rung.size < 2:
        return "no gap", (), ((), *(sets if rung.size else ()))
    share = rung.excess / max(rung.explained, 1e-9)
    strange = rung.p_misfit < rules.alpha_misfit and share > rules.misfit_share
    if strange or not rung.size:
        return "none of the library", (), sets
    if len(near) > 1:
        return "either", near, sets
    return ("effect" if rung.size == 1 else "together"), near[:1], sets


def _angle(problem: Problem, tied: Sequence[Point]) -> float:
    rest = problem.rest
    return angle(rest - tied[0].rest, rest - tied[1].rest)
