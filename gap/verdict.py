"""From fits to one answer, never surer than the recording allows."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Protocol

import numpy as np

from bns.gap.fit import Point
from bns.gap.null import Null, spread
from bns.gap.problem import Problem
from bns.gap.quantify import flexible
from bns.gap.records import Verdict
from bns.gap.select import Search, held_out
from bns.gap.signatures import angle
from bns.gap.whiten import loss

MINOR = 0.015  # share of what is explained below which a further effect is not named
LISTED = 4  # supports named in a sentence at most


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
        coverage: of the sets.
        scores: loss of the true support over the best one's, per calibration case.
    """

    alpha_gap: float = 0.02
    alpha_misfit: float = 0.01
    misfit_share: float = 0.02
    tie: float = 6.0
    sure: float = 6.0
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
        size: number of effects needed.
        best: the best support of that size.
        ranked: all fitted supports of that size with their scores, best first.
        p_gap, p_misfit, excess: see `Null`.
        explained: improvement of the best support on nothing.
        left: what a flexible model, fitted on other trials, still improves on the best
            support, and the standard error of that over trials.
    """

    size: int
    best: Point
    ranked: tuple[tuple[Point, float], ...]
    p_gap: float
    p_misfit: float
    excess: float
    explained: float
    left: tuple[float, float]

    @property
    def scores(self) -> list[tuple[tuple[str, ...], float]]:
        """Names and scores of the supports, best first."""
        return [(point.names, score) for point, score in self.ranked]


def choose(problem: Problem, search: Search, null: Null, worth: float) -> Choice:
    """How many effects, and the supports of that size in order.

    An effect is added only if it improves the loss by more than chance would and by
    more than `MINOR` of the whole (a nominal model that is a little wrong always
    leaves something), and the held-out loss by more than one standard error.
    """
    size = 0
    nothing = search.nothing
    gain = nothing.loss - min(search.best(1).loss, nothing.loss)
    p_gap = min(1.0, 2 * min(null.p_gain(gain), null.misfit(problem, nothing.rest)[0]))
    for more in range(1, len(search.sizes) + 1):
        new, old = search.best(more), search.best(size)
        if new is None:
            continue
        least = max(worth, MINOR * (nothing.loss - new.loss))
        if old.loss - new.loss <= least:
            continue
        total, by_new = held_out(problem, new)
        before, by_old = held_out(problem, old)
        error = (by_old - by_new).std(ddof=1) * np.sqrt(len(by_old))
        if before - total > min(error, worth):
            size = more
    best = search.best(size)
    points = search.sizes[size - 1] if size else (nothing,)
    scale = max(1.0, spread(best.rest)) ** 2
    ranked = tuple((point, (point.loss - best.loss) / scale) for point in points)
    p_misfit, excess = null.misfit(problem, best.rest)
    explained = nothing.loss - best.loss
    left = _left(problem, null, best)
    return Choice(size, best, ranked, p_gap, p_misfit, excess, explained, left)


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
    kind, named, sets = judge(choice, calibration)
    tied = [point for point, score in choice.ranked if score <= calibration.sure]
    rivals = [(p, s) for p, s in choice.ranked if s > calibration.sure]
    second, margin = (rivals[0][0].names, rivals[0][1]) if rivals else ((), np.inf)
    between = _angle(problem, tied) if kind == "either" else 90.0
    return Verdict(
        kind=kind,
        named=named,
        sets=sets,
        angle=between,
        p_gap=choice.p_gap,
        p_misfit=choice.p_misfit,
        second=second,
        margin=float(margin),
        sentence=sentence(kind, choice, tied, between),
        change=change(kind, tied, second, float(margin), excite),
    )


class Weighed(Protocol):
    """What is needed of a `Choice` to judge it."""

    size: int
    p_gap: float
    p_misfit: float
    excess: float
    explained: float

    @property
    def scores(self) -> Sequence[tuple[tuple[str, ...], float]]:
        """Names and scores of the supports, best first."""
        ...


def judge(
    choice: Weighed, rules: Calibration
) -> tuple[str, tuple[tuple[str, ...], ...], tuple[tuple[str, ...], ...]]:
    """Kind, named supports and the 90 % set, see `Verdict`."""
    sets = tuple(names for names, score in choice.scores if score <= rules.tie)
    near = tuple(names for names, score in choice.scores if score <= rules.sure)
    if choice.p_gap > rules.alpha_gap and choice.size < 2:
        return "no gap", (), ((), *(sets if choice.size else ()))
    share = choice.excess / max(choice.explained, 1e-9)
    strange = choice.p_misfit < rules.alpha_misfit and share > rules.misfit_share
    if strange or not choice.size:
        return "none of the library", (), sets
    if len(near) > 1:
        return "either", near, sets
    return ("effect" if choice.size == 1 else "together"), near[:1], sets


def _angle(problem: Problem, tied: Sequence[Point]) -> float:
    rest = problem.rest
    return angle(rest - tied[0].rest, rest - tied[1].rest)


def _text(point: Point) -> str:
    parts = [
        f"{term.candidate.name} ({term.candidate.parameter} = {term.magnitude:.4g}"
        f" {term.candidate.unit})".replace(" 1)", ")")
        for term in point.terms
    ]
    return " with ".join(parts)


def sentence(kind: str, choice: Choice, tied: Sequence[Point], between: float) -> str:
    """The answer in words."""
    if kind == "no gap":
        return (
            "No gap beyond what the recording scatters by itself "
            f"(p = {choice.p_gap:.3g})."
        )
    if kind == "none of the library":
        best = _text(choice.best) or "nothing"
        return (
            f"There is a gap (p = {choice.p_gap:.2g}), and no effect of the library "
            f"explains it: after the best, {best}, the rest still has structure "
            f"(p = {choice.p_misfit:.2g})."
        )
    if kind == "either":
        names = " or ".join(_text(point) for point in tied[:LISTED])
        more = f" or {len(tied) - LISTED} more" if len(tied) > LISTED else ""
        return (
            f"Either {names}{more}: these data cannot tell (angle between the first "
            f"two {between:.1f} deg)."
        )
    if kind == "effect":
        return f"The gap is explained by {_text(choice.best)}."
    return f"The gap is explained by {_text(choice.best)} together."


def change(
    kind: str,
    tied: Sequence[Point],
    second: tuple[str, ...],
    margin: float,
    excite: dict[str, str],
) -> str:
    """What would change the answer, in words."""
    wanted = sorted({excite.get(n, "") for p in tied for n in p.names} - {""})
    if kind == "either":
        return f"A recording with {' and '.join(wanted)} may separate them."
    if kind == "no gap":
        return "A longer or less noisy recording would show smaller effects."
    if kind == "none of the library":
        return "An effect that the library lacks; see where and when the gap sits."
    if not second:
        return "No other support that was fitted comes near."
    return f"Second best: {' with '.join(second)}, its loss larger by {margin:.1f}."
