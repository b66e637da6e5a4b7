"""Steps of derivatives: of rows, that what they change stands out of what a simulation
with contacts does itself, and of time, as long as they change no derivative.

A wheel on its rim, or a foot that lands a step sooner, moves a body by a little,
whatever is changed and however little. A derivative by a step that changes no more than
that is the simulation's, not the robot's, so rows take a larger step: as far as a slope
is trusted, or as far as they plausibly depart, where the motion is as linear so far.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import compress
from typing import NamedTuple

import numpy as np

from bns.gap.decomposition import fit
from bns.gap.decomposition.row import Row

Changes = Sequence[Mapping[str, float]]
Paths = list[np.ndarray]
Simulated = Callable[[Sequence[Changes], float], list[Paths]]
Changed = Callable[[Sequence[Mapping[str, float]]], np.ndarray]
"""what each set of values changes of the nominal motion, in units of the noise,
``(E, N, C)``; values by row"""

MOST = 120
"""rows of a model that is looked at: of more, better slopes make more sets that promise
something, each of which is followed (a quadruped of 174: the same verdict in twice the
time)"""
TINY = 0.03  # of a row's step: what it changes is roughness, if it is not small
SHARE = 3.0  # times what it would be in proportion: small
PROBED = 12  # rows that tell the roughness
QUANTILE = 0.75  # of theirs: it is of the motion, not of the row; some change nothing
FELT = 0.05  # of the noise: a roughness below is none
ABOVE = 5.0  # times the roughness that a step has to change
ALIKE = 3.0  # times it, by which steps that tell the same derivative may differ
CLOSE = 0.05  # of what a row changes: by as much a longer step of time may be off,
HELD = 0.2  # or so much of the noise of what is to be explained, if that is less
SLIGHT = 0.1  # of the noise, by a plausible departure: the same
TWICE = 2.0  # times the roughness: two such motions differ by as much
SOME = 0.25  # of the rows: as many may need the model's own step of time


class Pace(NamedTuple):
    """By which steps of time is simulated what rows change.

    Attributes:
        parts: into which the model's step is cut; 1/4 = four in one.
        own: names of the rows that keep the model's own step.
    """

    parts: float = 1
    own: frozenset[str] = frozenset()

    def paths(self, sets: Sequence[Changes], simulated: Simulated) -> list[Paths]:
        """Paths of sets of changes, for differences from the first. Sets with rows that
        keep the model's own step differ from it by what they do at that.

        Args:
            sets: of each, by trial, the values of the rows that are not nominal.
            simulated: simulates sets, each step of the model cut into so many parts.
        """
        own = [any(values.keys() & self.own for values in row) for row in sets]
        if own[0]:
            return simulated(sets, 1)
        made = simulated([*compress(sets, np.logical_not(own))], self.parts)
        if any(own):
            base, *others = simulated([sets[0], *compress(sets, own)], 1)
            for at, paths in zip(np.flatnonzero(own), others, strict=True):
                parts = zip(made[0], paths, base, strict=True)
                made.insert(int(at), [here + (b - a) for here, b, a in parts])
        return made


def level(rows: Sequence[Row], changed: Changed) -> float:
    """What a simulation with contacts changes itself, in units of the noise.

    Args:
        rows: of a model.
        changed: simulates values of rows.
    """
    tried = _tried([_as_far_as_trusted(row) for row in rows])
    if not tried:
        return 0.0
    probed = tried[:: max(len(tried) // PROBED, 1)]
    tiny = _sizes(changed([_moved(row, TINY * row.difference) for row in probed]))
    large = _sizes(changed([_moved(row, row.difference) for row in probed]))
    beyond = np.maximum(tiny - SHARE * TINY * large, 0.0)
    return float(np.quantile(beyond, QUANTILE))


def stepped(rows: Sequence[Row], changed: Changed, rough: float) -> tuple[Row, ...]:
    """Rows of which those whose step changes less than `ABOVE` times the roughness step
    as far as they plausibly depart, where the motion is as linear so far; as they are,
    where there is none, or rows are too many.

    Args:
        rows: of a model.
        changed: simulates values of rows.
        rough: the roughness, see `level`.
    """
    rows = tuple(_as_far_as_trusted(row) for row in rows)
    small = [row for row in _tried(rows) if row.difference < row.sd]
    if rough < FELT or not small or len(rows) > MOST:
        return rows
    near = changed([_moved(row, row.difference) for row in small])
    lost = np.flatnonzero(_sizes(near) < ABOVE * rough)
    if not len(lost):
        return rows
    far = changed([_moved(small[n], small[n].sd) for n in lost])
    ratio = np.array([small[n].difference / small[n].sd for n in lost])
    alike = _sizes(near[lost] - far * ratio[:, None, None]) < ALIKE * rough
    names = {small[n].name for n in lost[alike]}
    return tuple(replace(r, step=r.sd) if r.name in names else r for r in rows)


def of_pace(
    rows: Sequence[Row],
    paces: Sequence[float],
    changed: Callable[[float], Changed],
    rough: float,
    gap: float,
) -> Pace:
    """That of the longest step of time by which nearly all rows change the same as by
    the model's own.

    Args:
        rows: of a model.
        paces: parts of its own step, the longest steps first; 1/4 = four in one.
        changed: simulates values of rows at a pace.
        rough: what the simulation changes itself, see `level`.
        gap: root mean square of what is to be explained, in units of the noise.
    """
    off = partial(_apart, rough=rough, close=min(CLOSE, HELD / max(gap, 1e-9)))
    for pace in paces:
        for looked_at in (rows[:: max(len(rows) // PROBED, 1)], rows):
            near, far = (_derivatives(looked_at, changed(each)) for each in (1, pace))
            apart = off(looked_at, near, far)
            if apart.mean() > SOME:
                break
        else:
            return Pace(pace, frozenset(row.name for row in compress(rows, apart)))
    return Pace()


def _derivatives(rows: Sequence[Row], changed: Changed) -> np.ndarray:
    """What a plausible departure of each row changes, in proportion to what its step
    does, or a level where it has no slope, ``(E, N, C)``."""
    made: np.ndarray = changed([{row.name: _probe(row)[0]} for row in rows])
    return made * _scales(rows)[:, None, None]


def _probe(row: Row) -> tuple[float, float]:
    """The value at which a row is looked at, and plausible departures over the step to
    it: a level in the middle, and 1, where it has no slope."""
    if row.levels and not row.smooth:
        return row.levels[len(row.levels) // 2], 1.0
    step = row.inward(row.nominal, row.difference)
    return row.nominal + step, row.sd / abs(step) if step else 1.0


def _scales(rows: Sequence[Row]) -> np.ndarray:
    return np.array([_probe(row)[1] for row in rows])


def _apart(
    rows: Sequence[Row], near: np.ndarray, far: np.ndarray, rough: float, close: float
) -> np.ndarray:
    """Which rows, ``(E,)``, a longer step of time changes what they do, beyond what a
    simulation changes itself; NaN where one diverged."""
    lost = (np.isfinite(near) & ~np.isfinite(far)).any(axis=(1, 2))
    most = SLIGHT + close * _sizes(near) + TWICE * rough * _scales(rows)
    found: np.ndarray = lost | (_sizes(far - near) > most)
    return found


def _tried(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row.smooth and not row.nuisance and not row.joins]


def _as_far_as_trusted(row: Row) -> Row:
    plain = row.smooth and not row.nuisance and not row.step
    return replace(row, step=fit.FAR * row.sd) if plain else row


def _sizes(changes: np.ndarray) -> np.ndarray:
    """Root mean squares of changes ``(E, N, C)``, ``(E,)``; of what was seen."""
    seen = np.isfinite(changes)
    total = (np.where(seen, changes, 0.0) ** 2).sum(axis=(1, 2))
    sizes: np.ndarray = np.sqrt(total / np.maximum(seen.sum(axis=(1, 2)), 1))
    return sizes


def _moved(row: Row, step: float) -> dict[str, float]:
    """The value a step away from the nominal one, by the row's name."""
    return {row.name: row.nominal + row.inward(row.nominal, step)}
