"""Numbers of a model that may be wrong, as effects with a range.

"wheel_gain:wheel=left,factor=0.2..1.2" is one number. All of them together are a point
in a cube, each coordinate from 0 to 1.
"""

import re
from collections.abc import Sequence

import numpy as np

from bns.errors import BnsError
from bns.prior.breeding import inside
from bns.worlds.damage import Damage

_RANGE = re.compile(r"(\w+)=(-?[\d.]+?)\.\.(-?[\d.]+)")
PULL, APART, STEP, TAKEN = 0.5, 0.6, 0.02, 0.9
"""share of the way to the best guess, of the difference of two, standard deviation of a
step, and share of coordinates that move; with a stronger pull all guesses were soon
alike, and later tests found none that fitted"""
SWAPPED, ANEW = 0.25, 0.15
"""shares of children in which two coordinates are exchanged, or one is drawn anew"""


class Unknowns:
    """What may be wrong with a robot.

    Args:
        texts: an effect each, one of its numbers as a range.

    Attributes:
        nominal: where nothing is wrong, ``(P,)``.

    Raises:
        BnsError: no range, or an effect that there is not.
    """

    def __init__(self, texts: Sequence[str]):
        self._texts, ranges, nominal = [], [], []
        for text in texts:
            found = _RANGE.search(text)
            if found is None or not float(found[2]) < float(found[3]):
                raise BnsError(
                    f"{text!r} is no effect with a range: write for example "
                    "wheel_gain:wheel=left,factor=0.2..1.2."
                )
            written = _RANGE.sub(r"\1={:.6g}", text)
            effect = Damage.parse([written.format(float(found[2]))]).events[0].effect
            named = {item.name: item.nominal for item in effect.parameters}
            self._texts.append(written)
            ranges.append((float(found[2]), float(found[3])))
            nominal.append(named[found[1]])
        self.low, self._high = np.array(ranges).reshape(-1, 2).T
        self.nominal = ((np.array(nominal) - self.low) / self._width).clip(0, 1)

    def __len__(self) -> int:
        return len(self._texts)

    @property
    def _width(self) -> np.ndarray:
        return self._high - self.low

    def values(self, points: np.ndarray) -> np.ndarray:
        """In the effects' own units, shape as `points`."""
        found: np.ndarray = self.low + points * self._width
        return found

    def damages(self, points: np.ndarray) -> list[Damage]:
        """What is wrong with each of N robots.

        Args:
            points: ``(N, P)``.
        """
        return [
            Damage.parse(
                text.format(value) for text, value in zip(self._texts, row, strict=True)
            )
            for row in self.values(points)
        ]

    def random(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Guesses: the model as it is, and others anywhere, ``(count, P)``."""
        points = rng.random((count, len(self)))
        points[0] = self.nominal
        return points


def varied(
    points: np.ndarray, misses: np.ndarray, rows: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Children of guesses, by differential evolution (Storn and Price 1997).

    Each is drawn half-way to the best one and moved along the difference of two others
    ("current to best"), in most coordinates, and a little by chance. Some exchange two
    coordinates instead, or get one anew: what seems wrong with one leg may be wrong
    with another. (Two numbers alone are found sooner without.)

    Args:
        points: ``(M, P)``.
        misses: how wrong each was, ``(M,)``.
        rows: of the parents, ``(N,)``.
        rng: the only source of randomness.

    Returns:
        ``(N, P)``.
    """
    best = points[misses.argmin()]
    one, other = rng.integers(len(points), size=(2, len(rows)))
    parents = points[rows]
    moved = parents + PULL * (best - parents) + APART * (points[one] - points[other])
    moved += STEP * rng.standard_normal(moved.shape)
    taken = rng.random(moved.shape) < TAKEN
    children = inside(np.where(taken, moved, parents))
    kinds = rng.random(len(rows)) if points.shape[1] > 2 else np.ones(len(rows))
    for row in np.flatnonzero(kinds < SWAPPED + ANEW):
        children[row] = parents[row]
        first, second = rng.integers(parents.shape[1], size=2)
        if kinds[row] < SWAPPED:
            children[row, [first, second]] = parents[row, [second, first]]
        else:
            children[row, first] = rng.random()
    return children
