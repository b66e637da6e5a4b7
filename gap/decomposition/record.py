"""A decomposition written down as a diagnosis: verdict, statements, fits."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bns.gap.decomposition import fit as fits
from bns.gap.decomposition import rest, search, shares, words
from bns.gap.decomposition.decomposition import LARGE, Decomposition
from bns.gap.decomposition.linear import Support
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row
from bns.gap.decomposition.shares import Part, Sized
from bns.gap.records import Diagnosis, Fit, Verdict
from bns.gap.where import horizons, localised
from bns.gap.where.compared import Compared

SINGLES = 8  # explanations whose share alone is reported
HALF = 0.5  # of a gap: what is left where most is within the model's own doubts
SCATTERED = "That does not recur: the robot or its measurement scatters it."
INEXACT = (
    f"It recurs, but is within {100 * Row.inexact:g} % of the motion, to which a "
    "simulation is taken to be exact."
)
UNSURE = (
    "The nominal model is unsure by as much, of its timing first: a shift of some "
    "milliseconds, gains by thousandths."
)


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
    sets = tuple(_ordered(made.told, support) for support in made.told.tied)
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
    near = search.near(made.point.linear, 50.0)
    return [(cost, s) for cost, s in near if s not in made.tied and cost > 0]


def _change(made: Decomposition, kind: str) -> str:
    if kind == "no gap":
        return "A longer or less noisy recording would show smaller effects."
    if kind == "none of the library":
        listed = ", ".join(sorted(made.elsewhere))
        if listed:
            return f"List in [effects] what explains it: {listed}."
        return "An effect that the library lacks; see where and when the gap sits."
    if kind != "either":
        return ""
    return words.apart(made.tied, made.problem.rows)


def _ordered(made: Decomposition, support: Support) -> tuple[str, ...]:
    """Names of a set, the largest share first."""
    rank = {part.name: at for at, part in enumerate(made.parts)}
    return tuple(sorted(support, key=lambda name: (rank.get(name, len(rank)), name)))


def statements(made: Decomposition) -> list[str]:
    """The three statements: size, explanation, rest."""
    problem, features = made.problem, made.problem.model.features
    apart = (
        "".join(
            f" Trial {number} is left out: it may go anywhere within what the model is "
            "uncertain by."
            for number in made.unstable
        )
        + "".join(
            f" Trial {number} went another way than its repeat and does not count."
            for number in made.strayed
        )
        + "".join(
            f" Trial {number} departs as {name} would have it, and no other does: "
            "it is not named."
            for name, number in made.unconfirmed.items()
        )
    )
    before, beyond = rest.sizes(made.start.rest, made.floor, made.inside)
    size = words.size(before, beyond, features, _over(problem))
    if made.kind == "no gap":
        said = ["No gap beyond what the recording scatters by itself." + apart]
        if made.before > LARGE:
            why = INEXACT if made.recurring else SCATTERED
            said += [size, UNSURE if made.left < HALF else why]
        return said
    return [size, _explained(made), _left(made) + apart]


def _explained(made: Decomposition) -> str:
    """What explains how much of a gap."""
    listed = [_said(made, part) for part in made.parts]
    date = ""
    if made.onset:
        date = f"{made.onset.name} sets in at trial {made.onset.trial}."
    swapped = [" with ".join(_ordered(made, s)) for s in made.tied[1:]]
    return words.explained(listed, made.closed, date, swapped)


def _left(made: Decomposition) -> str:
    """How large the rest is, or what explains it that is not listed."""
    if made.unlisted:
        return f"With what [effects] does not list, {_explained(made.unlisted)}"
    _, left = rest.sizes(made.point.rest, made.floor, made.inside)
    text = words.left(
        made.left,
        made.lasting or made.failing,
        made.recurring,
        words.sized(left, made.problem.model.features),
        made.goes,
    )
    return text + (words.NOR if made.searched else "")


def _over(problem: Problem) -> str:
    """In what time a gap has grown, in words."""
    if problem.model.whole:
        spans = [float(trial.times[-1] - trial.times[0]) for trial in problem.trials]
        return f"in trials of {np.median(spans):.2g} s"
    window = np.median(np.concatenate([w.durations for w in problem.windows]))
    return f"over {window:.2g} s"


def _said(made: Decomposition, part: Part) -> str:
    """An explanation with its magnitude, interval, further numbers and share."""
    value, (low, high), unit = _magnitude(made.problem, part)
    return words.part(
        part,
        value,
        low,
        high,
        unit,
        _beside(made.problem, part),
        several=len(made.parts) > 1,
    )


def _beside(problem: Problem, part: Part) -> list[str]:
    """Further numbers of an explanation: what a dry friction takes to break away, where
    a load sits, which way a floor slopes."""
    effect = problem.model.effect(part.name, part.values)
    if effect is None or len(part.values) == 1:
        return []
    known = [
        about for about in effect.parameters if effect[about.name] != about.nominal
    ]
    return [
        f"{about.name} {effect[about.name]:.4g} {about.unit}".removesuffix(" 1")
        for about in known[1:]
    ]


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
    names = _ordered(made, support)
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
        text; magnitude, interval and unit as `_magnitude` gives them.
    """
    return str(problem.model.effect(name, part.values)), *_magnitude(problem, part)


def _magnitude(problem: Problem, part: Sized) -> tuple[float, tuple[float, float], str]:
    """Magnitude, interval and unit of an explanation: of the number called as it is, or
    without one of the first; of a size with a direction, the length."""
    rows = {row.name: row for row in problem.rows}
    names = list(part.values)
    called = part.name
    if called not in names or part.values[called] == rows[called].nominal:
        moved = [n for n in names if part.values[n] != rows[n].nominal] or names
        called = moved[0]
    unit = rows[called].unit
    both = [n for n in names if rows[n].unit == unit][:2]
    if called == part.name or len(both) == 1:
        return part.values[called], (part.low[called], part.high[called]), unit
    away = np.array([part.values[n] - rows[n].nominal for n in both])
    width = np.array([part.high[n] - part.low[n] for n in both])
    length = float(np.hypot(*away))
    half = float(np.abs(away) @ width / max(length, 1e-12)) / 2
    return length, (max(length - half, 0.0), length + half), unit


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
    other, told = made.unlisted, made.told
    rows = {row.name: row for row in told.problem.rows}
    names = [*_ordered(other, other.point.support)] if other else []
    apart = sorted({*told.unstable, *told.strayed})
    further: dict[str, Any] = {"unlisted": names} if made.searched else {}
    return (
        further
        | ({"left_out": apart} if apart else {})
        | {
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
            "statements": statements(made),
            "left": told.left,
            "recurs": told.recurs,
            "before": told.before,
            "after": told.after,
            "correlated": told.point.noise.lam,
            "onset": None
            if made.onset is None
            else {"name": made.onset.name, "trial": made.onset.trial},
        }
    )


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
