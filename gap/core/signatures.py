"""Signatures: what each candidate would do to the motion, over its whole range.

A derivative at the nominal value misses whatever has no slope there (a dead band, a
saturation), so each candidate is simulated at several magnitudes; between them its
signature is taken to be linear. Angles and distances between these curves say, before
any fit, what the recording can tell apart and how small an effect it can show.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bns.gap.core import adaptive_grid
from bns.gap.core.problem import Problem
from bns.gap.records import Candidate

PIECES = 4  # levels in each stretch between simulated magnitudes
RATIO, SMALLEST = 1.8, 2.0  # of whitened lengths next to the nominal; the least


@dataclass(frozen=True, eq=False)
class Curves:
    """Levels of all candidates, the nominal left out.

    Attributes:
        candidates: in order.
        owner: index of the candidate of each level, ``(L,)``.
        branch: its branch, ``(L,)``.
        magnitude: ``(L,)``.
        signature: whitened, ``(L, N)``.
        diverged: texts of the effects whose simulation did.
    """

    candidates: tuple[Candidate, ...]
    owner: np.ndarray
    branch: np.ndarray
    magnitude: np.ndarray
    signature: np.ndarray
    diverged: tuple[str, ...]

    def levels(self, candidate: int) -> np.ndarray:
        """Indices of a candidate's levels, ``(K,)``."""
        return np.flatnonzero(self.owner == candidate)

    def index(self, name: str) -> int:
        """Number of the candidate called `name`."""
        return [item.name for item in self.candidates].index(name)


def integer(candidate: Candidate) -> bool:
    """Whether only whole magnitudes make sense."""
    return candidate.whole


def trace(problem: Problem, candidates: Sequence[Candidate]) -> Curves:
    """Simulate all candidates, each at several magnitudes."""
    around = (
        adaptive_grid.simulated if getattr(problem.model, "winding", False) else _grid
    )
    curves, diverged = around(problem, candidates)
    owner, branches, magnitudes, rows = [], [], [], []
    for (number, branch), points in curves.items():
        for value, row in _between(candidates[number], points):
            owner.append(number)
            branches.append(branch)
            magnitudes.append(value)
            rows.append(row.astype(np.float32))
    return Curves(
        tuple(candidates),
        np.array(owner, dtype=int),
        np.array(branches, dtype=int),
        np.array(magnitudes),
        np.array(rows).reshape(len(rows), -1),
        diverged,
    )


def _grid(problem: Problem, candidates: Sequence[Candidate]) -> tuple[dict, tuple]:
    """All magnitudes of all candidates, in one batch; see `winding.simulated`."""
    sets, where = [], []
    for number, item in enumerate(candidates):
        for branch in range(len(item.branches)):
            for value in levels_of(problem, item):
                sets.append([item.make(value, branch)])
                where.append((number, branch, value))
    found = problem.signatures(sets, rough=True)
    finite = np.isfinite(found).all(axis=1)
    diverged = tuple(str(s[0]) for s, ok in zip(sets, finite, strict=True) if not ok)
    curves: dict[tuple[int, int], list] = {}
    for (number, branch, value), row, ok in zip(where, found, finite, strict=True):
        if ok:
            curves.setdefault((number, branch), []).append((value, row))
    return curves, diverged


def levels_of(problem: Problem, candidate: Candidate) -> tuple[float, ...]:
    """Those to simulate: of a stepped candidate one on each of its steps."""
    steps = getattr(problem.model, "steps", None)
    found = steps(candidate, problem.trials) if candidate.stepped and steps else ()
    return found or candidate.grid


def _between(candidate: Candidate, points: list) -> list[tuple[float, np.ndarray]]:
    if integer(candidate) or candidate.stepped:
        return points
    points = [*points, (candidate.nominal, np.zeros_like(points[0][1]))]
    points.sort(key=lambda item: item[0])
    made = []
    for (low, a), (high, b) in pairwise(points):
        for share in _shares(a, b):
            made.append((low + share * (high - low), a + share * (b - a)))
    made.append(points[-1])
    return [item for item in made if item[0] != candidate.nominal]


def _shares(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Where to put levels between two signatures: even, but geometric from nominal."""
    even = np.arange(PIECES) / PIECES
    if a.any() and b.any():
        return even
    length = max(float(np.linalg.norm(b - a)), 1e-12)
    fine = length / RATIO ** np.arange(1, 40)
    fine = fine[(fine > SMALLEST) & (fine < length / PIECES)] / length
    from_nominal = np.sort(np.concatenate([fine, even[1:]]))
    return np.append(0.0, from_nominal if not a.any() else np.sort(1 - from_nominal))


def strength(curves: Curves) -> np.ndarray:
    """Whitened length of each level's signature, ``(L,)``."""
    return np.sqrt((curves.signature.astype(float) ** 2).sum(axis=1))


def detectability(curves: Curves, seen: float) -> dict[str, float | None]:
    """Smallest departure from nominal that the recording shows, by candidate.

    Args:
        curves: the signatures.
        seen: whitened length of a signature that is found with 90 % power.

    Returns:
        |magnitude - nominal|, None where no magnitude reaches it ("not excited").
    """
    length = strength(curves)
    found: dict[str, float | None] = {}
    for number, item in enumerate(curves.candidates):
        best = np.inf
        for branch in range(len(item.branches)):
            for side in (-1, 1):
                offset = (curves.magnitude - item.nominal) * side
                mine = (curves.owner == number) & (curves.branch == branch)
                mine &= offset > 0
                best = min(best, _crossing(offset[mine], length[mine], seen, item))
        found[item.name] = None if np.isinf(best) else float(best)
    return found


def _crossing(offset, length, seen: float, item: Candidate) -> float:
    order = np.argsort(offset)
    offset, length = offset[order], length[order]
    if integer(item):  # fewer is stronger: the rarest that is still seen
        return float(max(offset[length >= seen], default=np.inf))
    offset, length = np.append(0.0, offset), np.append(0.0, length)
    over = np.flatnonzero(length >= seen)
    if not len(over):
        return np.inf
    i = over[0]
    share = (seen - length[i - 1]) / (length[i] - length[i - 1])
    return offset[i - 1] + share * (offset[i] - offset[i - 1])


def distance(curves: Curves, signature: np.ndarray) -> np.ndarray:
    """Whitened distance of a signature to each candidate's curve, ``(C,)``."""
    gaps = ((curves.signature - signature) ** 2).sum(axis=1)
    return np.sqrt(
        [
            min(gaps[curves.levels(number)], default=np.inf)
            for number in range(len(curves.candidates))
        ]
    )


def nearest(curves: Curves, signature: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared distance of a signature to each candidate's curve, and the level there.

    A curve is the line through its levels, from the nominal on.

    Returns:
        ``(C,)`` each; infinite and 0 for a candidate without levels.
    """
    count = len(curves.candidates)
    gaps, at = np.full(count, np.inf), np.zeros(count, dtype=int)
    for number, item in enumerate(curves.candidates):
        for branch in range(len(item.branches)):
            mine = np.flatnonzero((curves.owner == number) & (curves.branch == branch))
            for side in (-1, 1):
                offset = (curves.magnitude[mine] - item.nominal) * side
                order = mine[offset > 0][np.argsort(offset[offset > 0])]
                ends = curves.signature[order].astype(float)
                if not len(ends):
                    continue
                begins = np.concatenate([np.zeros((1, ends.shape[1])), ends[:-1]])
                step = ends - begins
                size = np.maximum((step**2).sum(axis=1), 1e-12)
                share = ((signature - begins) * step).sum(axis=1) / size
                share = np.clip(share, 0.0, 1.0)[:, None]
                gap = ((signature - begins - share * step) ** 2).sum(axis=1)
                if gap.min() < gaps[number]:
                    gaps[number], at[number] = gap.min(), order[gap.argmin()]
    return gaps, at


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Between two whitened signatures [deg], 0..90 (a sign does not count)."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    if size == 0:
        return 90.0
    return float(np.degrees(np.arccos(min(1.0, abs(float(a @ b)) / size))))
