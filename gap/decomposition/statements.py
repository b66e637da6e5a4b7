"""A decomposition in three statements: how large the gap is, what explains it, what is
left."""

import numpy as np

from bns.gap.decomposition import rest, words
from bns.gap.decomposition.decomposition import LARGE, Decomposition
from bns.gap.decomposition.evidence.linear import Support
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row
from bns.gap.decomposition.shares import Part, Sized

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


def of(made: Decomposition) -> list[str]:
    """The three statements; two where there is no gap, or one.

    Args:
        made: the decomposition.
    """
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
    swapped = [" with ".join(ordered(made, s)) for s in made.tied[1:]]
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
    value, (low, high), unit = magnitude(made.problem, part)
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
    units = {row.name: row.unit for row in problem.rows}
    made = []
    for about in known[1:]:
        unit = units.get(f"{part.name}.{about.name}", about.unit)
        made.append(f"{about.name} {effect[about.name]:.4g} {unit}".removesuffix(" 1"))
    return made


def magnitude(problem: Problem, part: Sized) -> tuple[float, tuple[float, float], str]:
    """Magnitude, interval and unit of an explanation: of the number called as it is, or
    without one of the first; of a size with a direction, the length.

    Args:
        problem: the recording.
        part: the explanation, sized.
    """
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


def ordered(made: Decomposition, support: Support) -> tuple[str, ...]:
    """Names of a set, the largest share first.

    Args:
        made: the decomposition whose shares count.
        support: the set.
    """
    rank = {part.name: at for at, part in enumerate(made.parts)}
    return tuple(sorted(support, key=lambda name: (rank.get(name, len(rank)), name)))
