"""Curves that wind: signatures simulated where a recording calls for them.

Contact makes a walking robot's signature turn as an effect grows: a line between two
simulated magnitudes may pass far from it. What explains a recording moves it about as
far as it departs. So each candidate is simulated from the nominal value outward until
it does more than that, and then at a magnitude that does about as much.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from bns.gap.core.problem import Problem
from bns.gap.records import Candidate

TRIES = 3  # magnitudes between two of the grid, at most
NEAR = 1.4  # factor on the whitened length within which a magnitude will do

Points = list[tuple[float, np.ndarray]]
"""magnitudes and their signatures"""


class _Side:
    """One side of the nominal value, on one branch of a candidate."""

    def __init__(self, item: Candidate, branch: int, side: int):
        self.item, self.branch, self.tries = item, branch, 0
        self.points: Points = []
        marks = [value for value in item.grid if (value - item.nominal) * side > 0]
        self._left = sorted(marks, key=self._off)

    def _off(self, value: float) -> float:
        return abs(value - self.item.nominal)

    def wanted(self, length: float) -> float | None:
        """The next magnitude to simulate; None = it is near the length, or no use."""
        own = sorted(
            (self._off(v), v, float(np.linalg.norm(r))) for v, r in self.points
        )
        if any(length / NEAR < far < length * NEAR for _, _, far in own):
            return None
        ends = [(self.item.nominal, 0.0), *((value, far) for _, value, far in own)]
        for (a, near), (b, far) in pairwise(ends):
            if near < length <= far and not self.item.whole:
                self.tries += 1
                share = (length - near) / (far - near)
                return a + share * (b - a) if self.tries <= TRIES else None
        return self._left.pop(0) if self._left else None


def simulated(
    problem: Problem, candidates: Sequence[Candidate]
) -> tuple[dict[tuple[int, int], Points], tuple[str, ...]]:
    """Magnitudes of all candidates around what a recording departs by.

    Args:
        problem: the recording.
        candidates: in order.

    Returns:
        points by number of the candidate and branch; texts of the effects whose
        simulation diverged.
    """
    length, diverged = float(np.linalg.norm(problem.rest)), []
    sides = [
        ((number, branch), _Side(item, branch, side))
        for number, item in enumerate(candidates)
        for branch in range(len(item.branches))
        for side in (-1, 1)
    ]
    asked = sides
    while asked:
        wanted = [(part, part.wanted(length)) for _, part in asked]
        pairs = [(part, value) for part, value in wanted if value is not None]
        if not pairs:
            break
        sets = [[part.item.make(value, part.branch)] for part, value in pairs]
        rows = problem.signatures(sets, rough=True)
        for (part, value), effects, row in zip(pairs, sets, rows, strict=True):
            if np.isfinite(row).all():
                part.points.append((value, row))
            else:
                diverged.append(str(effects[0]))
        going = {id(part) for part, _ in pairs}
        asked = [item for item in asked if id(item[1]) in going]
    made: dict[tuple[int, int], Points] = {}
    for key, part in sides:
        made.setdefault(key, []).extend(part.points)
    return {key: points for key, points in made.items() if points}, tuple(diverged)
