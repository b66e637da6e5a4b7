"""A decomposition written down as a diagnosis: verdict, statements, fits."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bns.gap.decomposition import fit as fits
from bns.gap.decomposition import rest, shares, statements, words
from bns.gap.decomposition.decomposition import Decomposition
from bns.gap.decomposition.evidence import search
from bns.gap.decomposition.evidence.linear import Support
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.shares import Sized
from bns.gap.records import Diagnosis, Fit, Verdict
from bns.gap.where import horizons, localised
from bns.gap.where.compared import Compared

SINGLES = 8  # explanations whose share alone is reported


def recorded(
    made: Decomposition,
    *,
    faults: Sequence[str],
    seed: int,
    seconds: dict[str, float],
    full: bool,
) -> Diagnosis:
    """A decomposition written down.

    Args:
        made: the decomposition.
        faults: what the check of the recording found.
        seed: of what is drawn.
        seconds: by stage; "where" is added if `full`.
        full: with localisation and the plain gap.
    """
    problem, model, told = made.problem, made.problem.model, made.told
    where: dict[str, Any] = {}
    closed = _closed(told)
    if full:
        began = time.perf_counter()
        where, plain = _where(told, seed=seed)
        seconds = {**seconds, "where": round(time.perf_counter() - began, 3)}
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
        fits=_fits(told),
        where=where,
        signatures=_signatures(told),
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
        seconds=seconds,
        partial={} if full else {"where": "not asked for"},
        decomposition=_decomposition(made),
    )


def _verdict(made: Decomposition) -> Verdict:
    kind = made.kind
    named: tuple[tuple[str, ...], ...] = ()
    sets = tuple(statements.ordered(made.told, support) for support in made.told.tied)
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
        second=statements.ordered(made, rivals[0][1]) if rivals else (),
        margin=float(rivals[0][0]) if rivals else float("inf"),
        sentence=" ".join(statements.of(made)),
        change=_change(made, kind),
    )


def _rivals(made: Decomposition) -> list[tuple[float, Support]]:
    near = search.near(made.point.linear, 50.0)
    return [(cost, s) for cost, s in near if s not in made.tied and cost > 0]


def _change(made: Decomposition, kind: str) -> str:
    if kind == "no gap":
        return "A longer or less noisy recording would show smaller effects."
    if kind == "none of the library":
        if made.elsewhere:
            names = statements.ordered(made.told, made.elsewhere)
            return f"List in [effects] what explains it: {', '.join(names)}."
        return "An effect that the library lacks; see where and when the gap sits."
    if kind != "either":
        return ""
    return words.apart(made.tied, made.problem.rows)


def _fits(made: Decomposition) -> tuple[Fit, ...]:
    """The fits of what is named, of each alone, and of nothing."""
    linear = made.point.linear
    wanted = [s for s in made.tied if s <= set(linear.terms)]
    order = sorted(linear.free, key=lambda name: linear.cost({name}))[:SINGLES]
    wanted += [frozenset({n}) for n in order if frozenset({n}) not in wanted]
    if frozenset() not in wanted:
        wanted.append(frozenset())
    return tuple(_fit(made, support) for support in wanted)


def _fit(made: Decomposition, support: Support) -> Fit:
    problem, point = made.problem, made.point
    values = point.values
    if support != point.support:
        values = fits.placed(problem, point.linear, support, point.values)
    sized = shares.sized(problem, replace(point, values=values, support=support))
    order = {one.name: one for one in sized}
    names = statements.ordered(made, support)
    shown = [shown_effect(problem, name, order[name]) for name in names]
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


def _at_bound(problem: Problem, part: Sized) -> bool:
    rows = {row.name: row for row in problem.rows}
    return any(value in (rows[n].low, rows[n].high) for n, value in part.values.items())


def shown_effect(
    problem: Problem, name: str, part: Sized
) -> tuple[str, float, tuple[float, float], str]:
    """Text, magnitude, interval and unit of an explanation.

    Args:
        problem: the recording.
        name: of the explanation.
        part: its values and intervals.

    Returns:
        text; magnitude, interval and unit as `statements.magnitude` gives them.
    """
    size = statements.magnitude(problem, part)
    return str(problem.model.effect(name, part.values)), *size


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
    """The parts with their shares, and the three statements; what is named by effects
    that the description does not list, if these were searched; numbers of the trials
    that do not count."""
    told, other = made.told, made.unlisted
    rows = {row.name: row for row in told.problem.rows}
    further: dict[str, Any] = {}
    if made.searched:
        names = statements.ordered(other, other.point.support) if other else ()
        further["unlisted"] = [*names]
    if apart := sorted({*told.unstable, *told.strayed}):
        further["left_out"] = apart
    return further | {
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
            for part in told.parts
        ],
        "statements": statements.of(made),
        "left": told.left,
        "recurs": told.recurs,
        "before": told.before,
        "after": told.after,
        "correlated": told.point.noise.lam,
        "onset": None
        if made.onset is None
        else {"name": made.onset.name, "trial": made.onset.trial},
    }


def _where(made: Decomposition, *, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Localisation of the gap, and its size over a second before and after.

    Args:
        made: a decomposition.
        seed: of the bootstraps.
    """
    problem = made.problem
    compared = Compared.of(problem.trials, problem.model, made.floor.sigma)
    effects = [
        effect
        for part in made.parts
        if (effect := problem.model.effect(part.name, part.values)) is not None
    ]
    found = localised.where(compared, effects, seed=seed)
    return found, horizons.plain_gap(compared, effects)
