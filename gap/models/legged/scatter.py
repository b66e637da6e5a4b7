"""What a walking robot scatters although nothing is wrong with it.

Contact makes walking chaotic: a robot that is a little heavier, or grips a little
better, than its model soon puts a foot down elsewhere, and how far that carries is not
in proportion to the difference. So the nominal model is simulated with all that it is
not sure of drawn at random, many times. What these walks do otherwise than the one in
their midst are directions along which a recording may depart: nuisances of the fit.
Robots that lack a leg stumble where whole ones walk, so what a recording has probably
lost (`likely`) is lost in these walks as well.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from bns import seeding
from bns.gap.decomposition.row import Row
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

WALKS = 48  # drawn
NAME = "walk[{}]"
BETTER = 0.7  # of the servos' squared departure, which a loss has to leave at most


def rows() -> tuple[Row, ...]:
    """How far a recording departs along each walk: together as far as walks do."""
    sd = 1 / np.sqrt(WALKS)
    return tuple(
        Row(NAME.format(number), 0.0, sd, -3.0, 3.0, nuisance=True, step=sd)
        for number in range(WALKS)
    )


def number(name: str) -> int:
    """Number of the walk that a row stands for; -1 = it is another row."""
    stem, _, rest = name.partition("[")
    return int(rest.rstrip("]")) if stem == "walk" else -1


def bare(values: Mapping[str, float]) -> dict[str, float]:
    """Values of rows, by name, without shares of walks."""
    return {name: value for name, value in values.items() if number(name) < 0}


def without(
    rests: Sequence[np.ndarray], walks: Sequence[np.ndarray], noise: float
) -> list[np.ndarray]:
    """What is left of departures once the walks that explain them best are taken out.

    Args:
        rests: recorded minus predicted positions of each trial, ``(T, J)`` [rad].
        walks: what each drawn walk does otherwise, ``(WALKS, T, J)`` [rad].
        noise: of a position, beside these [rad].
    """
    flat = np.concatenate([rest.ravel() for rest in rests])
    seen = np.isfinite(flat)
    ways = np.concatenate([made.reshape(WALKS, -1) for made in walks], axis=1)[:, seen]
    curvature = ways @ ways.T / noise**2 + WALKS * np.eye(WALKS)
    shares = np.linalg.solve(curvature, ways @ flat[seen] / noise**2)
    return [
        rest - np.tensordot(shares, made, axes=1)
        for rest, made in zip(rests, walks, strict=True)
    ]


def robots(uncertain: Sequence[Row], count: int = WALKS) -> list[list[Effect]]:
    """Robots that the nominal model may stand for: what is uncertain, drawn together.

    Args:
        uncertain: rows with a slack.
        count: of robots; always the same ones.
    """
    rng = seeding.generator(0, "gap", "walk floor")
    return [_drawn(rng, uncertain) for _ in range(count)]


def _drawn(rng: np.random.Generator, uncertain: Sequence[Row]) -> list[Effect]:
    """One robot of those that the nominal model stands for."""
    made = []
    for row in uncertain:
        off = row.slack * float(rng.standard_normal())
        made.append(row.make(row.nominal + (abs(off) if _oneway(row) else off)))
    return made


def _oneway(row: Row) -> bool:
    return row.low == row.nominal


Simulate = Callable[[Sequence[Trial], Sequence[Sequence[Effect]]], list]


def likely(
    trials: Sequence[Trial], candidates: Sequence[Row], simulate: Simulate
) -> tuple[Effect, ...]:
    """Losses that explain the servos' positions best, one after the other.

    Args:
        trials: recordings, the joints' positions after the pose.
        candidates: what may be lost, each as a whole.
        simulate: see `GapModel.simulate`.

    Returns:
        none, where none explains much.
    """
    found: tuple[Effect, ...] = ()
    left = [item.make(item.high) for item in candidates]
    if not left:
        return found
    (before,) = _departures(trials, simulate(trials, [found]))
    while left:
        off = _departures(trials, simulate(trials, [(*found, item) for item in left]))
        best = int(np.argmin(off))
        if not off[best] < BETTER * before:
            break
        found, before = (*found, left.pop(best)), off[best]
    return found


def _departures(trials: Sequence[Trial], walks: Sequence) -> list[float]:
    """Mean squared departure of the servos in each set of walks; infinite: diverged."""
    made = []
    for paths in walks:
        rests = [
            t.observed[:, 3:] - p[:, 3:] for t, p in zip(trials, paths, strict=True)
        ]
        square = np.vstack(rests) ** 2
        lost = not all(np.isfinite(path).all() for path in paths)
        made.append(np.inf if lost else float(np.nanmean(square)))
    return made
