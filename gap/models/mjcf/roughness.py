"""Steps of derivatives: of rows, that what they change stands out of what a simulation
with contacts does itself, and of time, as long as they change no derivative.

A wheel on its rim, or a foot that lands a step sooner, moves a body by a little,
whatever is changed and however little. A derivative by a step that changes no more than
that is the simulation's, not the robot's, so rows take a larger step: as far as a slope
is trusted, or as far as they plausibly depart, where the motion is as linear so far.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bns.gap.decomposition import fit
from bns.gap.decomposition.row import Row

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
CLOSE = 0.05  # of what a row changes: by as much a longer step of time may be off
SLIGHT = 0.1  # of the noise, by a plausible departure: the same


def stepped(rows: Sequence[Row], changed: Changed) -> tuple[Row, ...]:
    """Rows of which those whose step changes less than `ABOVE` times the roughness step
    as far as they plausibly depart, where the motion is as linear so far; as they are,
    where there is none, or rows are too many.

    Args:
        rows: of a model.
        changed: simulates values of rows.
    """
    rows = tuple(_as_far_as_trusted(row) for row in rows)
    tried = [row for row in rows if row.smooth and not row.nuisance and not row.joins]
    if not tried or len(rows) > MOST:
        return rows
    probed = tried[:: max(len(tried) // PROBED, 1)]
    tiny = _sizes(changed([_moved(row, TINY * row.difference) for row in probed]))
    large = _sizes(changed([_moved(row, row.difference) for row in probed]))
    beyond = np.maximum(tiny - SHARE * TINY * large, 0.0)
    rough = float(np.quantile(beyond, QUANTILE))
    small = [row for row in tried if row.difference < row.sd]
    if rough < FELT or not small:
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


def _as_far_as_trusted(row: Row) -> Row:
    plain = row.smooth and not row.nuisance and not row.step
    return replace(row, step=fit.FAR * row.sd) if plain else row


def _sizes(changes: np.ndarray) -> np.ndarray:
    """Root mean squares of changes ``(E, N, C)``, ``(E,)``; of what was seen."""
    return np.sqrt(np.nan_to_num(np.nanmean(changes**2, axis=(1, 2))))


def _moved(row: Row, step: float) -> dict[str, float]:
    """The value a step away from the nominal one, by the row's name."""
    return {row.name: row.nominal + row.inward(row.nominal, step)}


def derivatives(rows: Sequence[Row], changed: Changed) -> np.ndarray:
    """What a plausible departure of each row changes, in proportion to what its step
    does, or a level in the middle where it has no slope, ``(E, N, C)``.

    Args:
        rows: of a model.
        changed: simulates values of rows.
    """
    steps = [row.inward(row.nominal, row.difference) for row in rows]
    middle = [row.levels[len(row.levels) // 2] if row.levels else 0.0 for row in rows]
    smooth = [row.smooth or not row.levels for row in rows]
    sets = [
        {row.name: row.nominal + step if even else level}
        for row, step, level, even in zip(rows, steps, middle, smooth, strict=True)
    ]
    scale = [
        row.sd / abs(step) if even and step else 1.0
        for row, step, even in zip(rows, steps, smooth, strict=True)
    ]
    made: np.ndarray = changed(sets) * np.array(scale)[:, None, None]
    return made


def apart(near: np.ndarray, far: np.ndarray) -> np.ndarray:
    """Which rows, ``(E,)``, a longer step of time changes what they do.

    Args:
        near: by the shorter step, see `derivatives`, ``(E, N, C)``.
        far: by the longer one; NaN where a simulation diverged.
    """
    lost = (np.isfinite(near) & ~np.isfinite(far)).any(axis=(1, 2))
    found: np.ndarray = lost | (_sizes(far - near) > CLOSE * _sizes(near) + SLIGHT)
    return found
