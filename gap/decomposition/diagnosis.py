"""From a recording to a diagnosis by the joint fit."""

import time
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bns.gap.decomposition import descent, onset, rest, shares, words
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.linear import Support
from bns.gap.decomposition.onset import Onset
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.shares import Part
from bns.gap.models.base import GapModel
from bns.gap.records import Diagnosis, Fit, Verdict
from bns.worlds.trial import Trial

MOST = 0.5  # share of the gap beyond which what is left is most of it
FELT = 0.02  # of the floor's variance: a gap below shows in no picture
LARGE = 2.0  # variances of the floor: more than heavy tails of any camera's noise
SCATTER = 3.0  # times what differs between repeats
SINGLES = 8  # explanations whose share alone is reported


@dataclass(frozen=True, eq=False)
class Decomposition:
    """What the joint fit found.

    Attributes:
        problem: the recording; split where something sets in.
        start: the nominal model.
        point: the explanations, fitted.
        parts: their shares, the largest first.
        tied: sets that the data cannot tell from the one of `point`, itself first.
        onset: what sets in; None = nothing.
        floor: what measuring scatters.
        before, after: excess over the floor of the nominal model and of `point`.
        recurs: standard errors by which what `point` leaves recurs.
        scatter: excess over the floor of what differs between repeats.
        closed: share closed on stretches that were not fitted.
    """

    problem: Problem
    start: Point
    point: Point
    parts: tuple[Part, ...]
    tied: tuple[Support, ...]
    onset: Onset | None
    floor: rest.Floor
    before: float
    after: float
    recurs: float
    scatter: float
    closed: float

    @property
    def left(self) -> float:
        """Share of the gap that is left."""
        return max(self.after, 0.0) / max(self.before, self.after, 1e-9)

    @property
    def lasting(self) -> bool:
        """Whether the rest is more than scatter: it recurs, or it is far beyond what
        measuring scatters and what differs between repeats."""
        if self.after <= self.scatter:
            return False
        if self.recurs > rest.SURE:
            return self.after > FELT
        return self.after > max(LARGE, SCATTER * self.scatter)

    @property
    def kind(self) -> str:
        """Kind of the verdict, one of `records.KINDS`."""
        if self.lasting and self.left > MOST:
            return "none of the library"
        if not self.point.support:
            return "no gap"
        if len(self.tied) > 1:
            return "either"
        return "effect" if len(self.point.support) == 1 else "together"


def decompose(problem: Problem, *, seed: int = 0) -> Decomposition:
    """Fit, date, guard against what makes held-out errors worse, and weigh the rest.

    Args:
        problem: the recording.
        seed: of the noise that measures the floor.
    """
    start = descent.nothing(problem)
    point = descent.decompose(problem, start)
    found = onset.dated(problem, start, point)
    late = None
    if found:
        problem, point, late = found
    support = shares.guarded(problem, point)
    if support != point.support:
        point = refitted(problem, point, support)
    known = rest.floor(problem, seed=seed)
    full = point.linear.rest(point.linear.solve(point.linear.free))
    inside = rest.kept(problem, full, point.noise.sd)
    left = point.linear.rest(point.linear.solve(point.support))
    plain = left if not point.noise.memory.factors.size else point.rest
    held = shares.HeldOut.of(problem, point, shares.PIECES)
    none, some = held.nominal(start.rest), held.error(point.support).sum()
    least = held.error(point.linear.free).sum()
    share = float((none - some) / max(none - min(least, some), 1e-9))
    return Decomposition(
        problem=problem,
        start=start,
        point=point,
        parts=tuple(shares.parts(problem, point)),
        tied=tuple(shares.swaps(point)),
        onset=late,
        floor=known,
        before=rest.excess(start.rest, known, inside),
        after=rest.excess(plain, known, inside),
        recurs=rest.recurrence(
            problem,
            left,
            point.noise.sd,
            piece=rest.SHORT if point.noise.order else rest.PIECE,
        ),
        scatter=rest.scattered(problem, plain, known, inside),
        closed=share if point.support else 0.0,
    )


def refitted(problem: Problem, point: Point, support: Support) -> Point:
    """A point with a smaller set, fitted to the simulation.

    Args:
        problem: the recording.
        point: a fitted set.
        support: the smaller set.
    """
    from bns.gap.decomposition import fit

    values = fit.placed(problem, point.linear, support, point.values)
    fitted = set(support) | fit.nuisances(problem)
    values, left = fit.newton(problem, values, fitted, point.noise)
    linear, known, slopes = fit.linearised(problem, values, left, point.noise)
    return Point(values, support, left, linear, slopes, known)


class Clock:
    """Seconds by stage."""

    def __init__(self):
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str):
        begin = time.perf_counter()
        yield
        self.seconds[stage] = round(time.perf_counter() - begin, 3)


def diagnose(
    trials: Sequence[Trial],
    model: GapModel,
    *,
    seed: int = 0,
    faults: Sequence[str] = (),
    full: bool = True,
    rows: Sequence[str] | None = None,
) -> Diagnosis:
    """A diagnosis of a checked recording.

    Args:
        trials: checked recording.
        model: nominal model.
        seed: of what is drawn.
        faults: what the check found.
        full: with localisation; False = the verdict alone.
        rows: names of the explanations that are considered, None = all.
    """
    clock = Clock()
    with clock("fit"):
        problem = Problem.of(trials, model)
        if rows is not None:
            problem = narrowed(problem, rows)
        made = decompose(problem, seed=seed)
    return recorded(made, faults=faults, seed=seed, clock=clock, full=full)


def narrowed(problem: Problem, names: Sequence[str]) -> Problem:
    """A problem with some explanations alone; nuisances stay."""
    kept = tuple(
        row for row in problem.rows if row.nuisance or {row.name, row.term} & set(names)
    )
    return replace(problem, rows=kept)


def recorded(
    made: Decomposition, *, faults, seed: int, clock: Clock, full: bool
) -> Diagnosis:
    """A decomposition written down.

    Args:
        made: the decomposition.
        faults: what the check of the recording found.
        seed: of what is drawn.
        clock: of the stages; "where" is added to it if `full`.
        full: with localisation and the plain gap.
    """
    problem, model = made.problem, made.problem.model
    where: dict[str, Any] = {}
    closed = _closed(made)
    if full:
        from bns.gap.decomposition import pictured

        with clock("where"):
            where, plain = pictured.where(made, seed=seed)
        closed["plain"] = plain
    if made.onset:
        where["change"] = {
            "trial": made.onset.trial,
            "place": made.onset.place,
            "time": 0.0,
            "direction": "sets in",
            "p": float(np.exp(-made.onset.gain)),
        }
    return Diagnosis(
        model=model.name,
        trials=len(problem.trials),
        faults=tuple(faults),
        verdict=_verdict(made),
        fits=_fits(made),
        where=where,
        signatures=_signatures(made),
        floor={
            "source": "the recording",
            "repeats": len(rest.repeats(problem)),
            "sigma": made.floor.sigma.tolist(),
            "process": np.asarray(model.process).tolist(),
            "channels": [channel.name for channel in model.channels],
            "features": np.median(made.point.noise.sd, axis=0).tolist(),
            "counted": made.point.noise.lam,
        },
        closed=closed,
        warnings=(),
        seed=seed,
        seconds=clock.seconds,
        partial={} if full else {"where": "not asked for"},
        decomposition=_decomposition(made),
    )


def _verdict(made: Decomposition) -> Verdict:
    kind = made.kind
    named: tuple[tuple[str, ...], ...] = ()
    sets = tuple(_ordered(made, support) for support in made.tied)
    if kind in ("effect", "together"):
        named = sets[:1]
    elif kind == "either":
        named = sets
    rivals = _rivals(made)
    return Verdict(
        kind=kind,
        named=named,
        sets=sets,
        angle=0.0 if kind == "either" else 90.0,
        p_gap=float(np.exp(min(made.point.cost - made.point.linear.cost(()), 0.0))),
        p_misfit=float(np.exp(-(max(made.recurs, 0.0) ** 2) / 2)),
        second=_ordered(made, rivals[0][1]) if rivals else (),
        margin=float(rivals[0][0]) if rivals else float("inf"),
        sentence=" ".join(statements(made)),
        change=_change(made, kind),
    )


def _rivals(made: Decomposition) -> list[tuple[float, Support]]:
    near = made.point.linear.near(50.0)
    return [(cost, s) for cost, s in near if s not in made.tied and cost > 0]


def _change(made: Decomposition, kind: str) -> str:
    if kind == "no gap":
        return "A longer or less noisy recording would show smaller effects."
    if kind == "none of the library":
        return "An effect that the library lacks; see where and when the gap sits."
    if kind != "either":
        return ""
    rows = {row.term: row for row in made.problem.rows}
    names = {name for support in made.tied for name in support}
    wanted = sorted({rows[name].excite for name in names} - {""})
    return f"A recording with {' and '.join(wanted)} may separate them."


def _ordered(made: Decomposition, support: Support) -> tuple[str, ...]:
    """Names of a set, the largest share first."""
    rank = {part.name: at for at, part in enumerate(made.parts)}
    return tuple(sorted(support, key=lambda name: (rank.get(name, len(rank)), name)))


def statements(made: Decomposition) -> list[str]:
    """The three statements: size, explanation, rest."""
    problem, features = made.problem, made.problem.model.features
    if made.kind == "no gap":
        return ["No gap beyond what the recording scatters by itself."]
    window = float(np.median(np.concatenate([w.durations for w in problem.windows])))
    before, beyond = _sizes(made, made.start.rest)
    _, left = _sizes(made, made.point.rest)
    listed = [words.part(part, *_main(made, part)) for part in made.parts]
    date = ""
    if made.onset:
        date = f"{made.onset.name} sets in at trial {made.onset.trial}."
    swapped = [" with ".join(_ordered(made, s)) for s in made.tied[1:]]
    return [
        words.size(before, beyond, features, window),
        words.explained(listed, made.closed, date, swapped),
        words.left(made.left, made.lasting, words.sized(left, features)),
    ]


def _sizes(made: Decomposition, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Root mean square by feature, and beyond the floor; without wild points."""
    full = made.point.linear.rest(made.point.linear.solve(made.point.linear.free))
    inside = rest.kept(made.problem, full, made.point.noise.sd)
    square = np.where(inside, np.nan_to_num(left) ** 2, 0.0).sum(axis=0)
    square /= np.maximum(inside.sum(axis=0), 1)
    beyond = np.maximum(square - (made.floor.sd**2).mean(axis=0), 0.0)
    return np.sqrt(square), np.sqrt(beyond)


def _main(made: Decomposition, part: Part) -> tuple[str, str]:
    """Unit and name of the row that stands for an explanation."""
    rows = {row.name: row for row in made.problem.rows}
    name = max(part.values, key=lambda n: abs(part.values[n] - rows[n].nominal))
    return rows[name].unit, name


def _fits(made: Decomposition) -> tuple[Fit, ...]:
    """The fits of what is named, of each alone, and of nothing."""
    linear = made.point.linear
    wanted = list(made.tied)
    order = sorted(linear.free, key=lambda name: linear.cost({name}))[:SINGLES]
    wanted += [frozenset({n}) for n in order if frozenset({n}) not in wanted]
    if frozenset() not in wanted:
        wanted.append(frozenset())
    return tuple(_fit(made, support) for support in wanted)


def _fit(made: Decomposition, support: Support) -> Fit:
    from bns.gap.decomposition import fit as fits

    problem, point = made.problem, made.point
    values = point.values
    if support != point.support:
        values = fits.placed(problem, point.linear, support, point.values)
    parts = shares.parts(problem, replace(point, values=values, support=support))
    order = {part.name: part for part in parts}
    names = _ordered(made, support)
    shown = [
        shown_effect(problem, name, order[name], made.floor.sd.shape) for name in names
    ]
    errors = point.linear.held_out(support)
    none = point.linear.held_out(())
    return Fit(
        names=names,
        effects=tuple(item[0] for item in shown),
        magnitudes=tuple(item[1] for item in shown),
        intervals=tuple(item[2] for item in shown),
        units=tuple(item[3] for item in shown),
        loss=point.linear.squares(support),
        held_out=float(errors.sum()),
        held_out_se=float((none - errors).std(ddof=1) * np.sqrt(len(errors))),
        evidence=2 * point.linear.cost(support),
        at_bound=tuple(n for n in names if _at_bound(problem, order[n])),
    )


def _at_bound(problem: Problem, part: Part) -> bool:
    rows = {row.name: row for row in problem.rows}
    return any(value in (rows[n].low, rows[n].high) for n, value in part.values.items())


def shown_effect(problem: Problem, name: str, part: Part, _shape):
    """Text, magnitude, interval and unit of an explanation.

    Args:
        problem: the recording.
        name: of the explanation.
        part: its values and intervals.
        _shape: not used.

    Returns:
        text; magnitude, which for several numbers is the length of the departure of the
        first two; its interval; unit of the first.
    """
    rows = {row.name: row for row in problem.rows}
    units = rows[next(iter(part.values))].unit
    made = problem.model.effect(name, part.values)
    values = np.array(list(part.values.values()))
    middle = np.array([rows[n].nominal for n in part.values])
    if len(values) == 1:
        (value,) = values
        (low,), (high,) = part.low.values(), part.high.values()
        return str(made), float(value), (float(low), float(high)), units
    length = float(np.hypot(*(values - middle)[:2]))
    width = np.array(list(part.high.values())) - np.array(list(part.low.values()))
    half = float(np.abs((values - middle) @ width) / max(length, 1e-12)) / 2
    return str(made), length, (max(length - half, 0.0), length + half), units


def _signatures(made: Decomposition) -> dict[str, Any]:
    """Smallest departure that would be found, and what comes first alone."""
    linear, problem = made.point.linear, made.problem
    normal = np.diagonal(linear.normal.sum(axis=0)) / linear.lam
    least: dict[str, float | None] = {}
    for name in linear.free:
        at = linear.terms[name][0]
        row = problem.rows[linear.columns[at]]
        if not row.smooth:
            continue
        # the evidence rises by more than it costs, nine times in ten
        size = np.sqrt(2 * (3.0 + 0.5 * np.log1p(normal[at]))) + 1.28
        least[name] = float(size / np.sqrt(normal[at]) * row.sd) if normal[at] else None
        if least[name] is not None and least[name] > row.high - row.low:
            least[name] = None
    ranked = sorted(linear.free, key=lambda n: linear.cost({n}))[:SINGLES]
    base = linear.cost(made.point.support)
    best = _fit(made, made.point.support)
    return {
        "detectability": least,
        "ranked": [
            {"names": [n], "score": 2 * (linear.cost({n}) - base)} for n in ranked
        ],
        "best": list(best.effects),
        "misfit_excess": made.after,
        "explained": made.before - made.after,
    }


def _closed(made: Decomposition) -> dict[str, Any]:
    """Loss per residual on stretches that were not fitted, 1 = noise alone."""
    linear = made.point.linear
    every = linear.held_out(linear.free)
    count = max(every.sum(), 1e-9)
    none, some = linear.held_out(()), linear.held_out(made.point.support)
    rng = np.random.default_rng(made.problem.block.size)
    drawn = rng.integers(0, len(none), (1000, len(none)))
    whole = np.maximum(none[drawn].sum(1) - np.minimum(every, some)[drawn].sum(1), 1e-9)
    spread = np.clip((none - some)[drawn].sum(axis=1) / whole, -1, 1)
    singles = {
        part.name: float(linear.held_out({part.name}).sum() / count)
        for part in made.parts
    }
    return {
        "before": float(none.sum() / count),
        "after": float(some.sum() / count),
        "floor": float(min(every.sum(), some.sum()) / count),
        "ceiling": float(every.sum() / count),
        "singles": singles,
        "closed": float(np.clip(made.closed, -1, 1)),
        "closed_interval": np.quantile(spread, [0.05, 0.95]).tolist(),
        "closed_by_flexible": float(1 - every.sum() / max(none.sum(), 1e-9)),
    }


def _decomposition(made: Decomposition) -> dict[str, Any]:
    """The parts with their shares, and the three statements."""
    rows = {row.name: row for row in made.problem.rows}
    return {
        "parts": [
            {
                "name": part.name,
                "values": part.values,
                "low": part.low,
                "high": part.high,
                "units": {n: rows[n].unit for n in part.values},
                "last": part.last,
                "alone": part.alone,
                "sure": part.sure,
            }
            for part in made.parts
        ],
        "statements": statements(made),
        "left": made.left,
        "recurs": made.recurs,
        "before": made.before,
        "after": made.after,
        "correlated": made.point.noise.lam,
        "onset": None
        if made.onset is None
        else {"name": made.onset.name, "trial": made.onset.trial},
    }
