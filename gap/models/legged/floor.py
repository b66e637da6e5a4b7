"""What a walking robot scatters although nothing is wrong with it: its whitener.

Contact makes walking chaotic: a robot that is a little heavier, or grips a little
better, than its model soon puts a foot down elsewhere, and how far that carries is not
in proportion to the difference. So the nominal model is simulated with all that it is
not sure of drawn at random, many times. What these walks have in common are directions
along which a recording may depart at no cost; what each has for itself, beyond what the
others foresee, adds to the noise of each feature in each window.
"""

from collections.abc import Sequence

import numpy as np

from bns import seeding
from bns.gap.core.problem import Problem
from bns.gap.core.whitening import Whitener
from bns.gap.records import Candidate
from bns.worlds.effects.base import Effect

WALKS = 120  # drawn; with 40 a walk now and then departs as none of them does
NEAR = 2  # windows to either side over which their own scatter is averaged
MOST = 1e3  # [noise] scatter that still counts


def robots(uncertain: Sequence[Candidate], count: int = WALKS) -> list[list[Effect]]:
    """Robots that the nominal model may stand for: what is uncertain, drawn together.

    Args:
        uncertain: candidates with a slack.
        count: of robots; always the same ones.
    """
    rng = seeding.generator(0, "gap", "walk floor")
    return [_drawn(rng, uncertain) for _ in range(count)]


def whitener(
    problem: Problem,
    paths: Sequence[Sequence[np.ndarray]],
    centre: Sequence[np.ndarray],
) -> Whitener:
    """The whitener of a recording of a walking robot.

    Args:
        problem: the recording, whitened by the noise alone.
        paths: what would have been observed of each of `robots`, by trial.
        centre: the same of the one in their midst, of which all is as it is told.
    """
    parts, compare = [], problem.model.compare
    for number, (trial, windows) in enumerate(
        zip(problem.trials, problem.windows, strict=True)
    ):
        seen = np.stack([walk[number] for walk in paths])
        midst = compare(trial, centre[number], windows)
        parts.append(compare(trial, seen, windows) - midst)
    walks = np.clip(np.nan_to_num(problem.whiten.many(parts)), -MOST, MOST)
    own = _smooth(problem, (_unforeseen(walks) ** 2).mean(axis=0))
    scale = np.sqrt(1 + own)
    base = problem.whiten
    factors = tuple(
        factor * scale[rows]
        for factor, rows in zip(base.factors, base.rows, strict=True)
    )
    plain = Whitener(factors, base.rows, base.basis, base.damping)
    return plain.uncertain(walks / scale / np.sqrt(len(walks)))


def _drawn(rng: np.random.Generator, uncertain: Sequence[Candidate]) -> list[Effect]:
    """One robot of those that the nominal model stands for."""
    made = []
    for item in uncertain:
        off = item.slack * float(rng.standard_normal())
        made.append(item.make(item.nominal + (abs(off) if _oneway(item) else off)))
    return made


def _oneway(item: Candidate) -> bool:
    return item.low == item.nominal


def _unforeseen(walks: np.ndarray) -> np.ndarray:
    """What of each walk the others do not foresee, ``(K, N)``."""
    made = np.empty_like(walks)
    for number, walk in enumerate(walks):
        others = np.delete(walks, number, axis=0) / np.sqrt(len(walks) - 1)
        inner = others @ others.T + np.eye(len(others))
        made[number] = walk - np.linalg.solve(inner, others @ walk) @ others
    return made


def _smooth(problem: Problem, values: np.ndarray) -> np.ndarray:
    """Each feature's values averaged over windows nearby."""
    made = np.empty_like(values)
    count = len(problem.model.features)
    kernel = np.ones(2 * NEAR + 1)
    for rows in problem.whiten.rows:
        table = values[rows].reshape(-1, count)
        weight = np.convolve(np.ones(len(table)), kernel, mode="same")
        made[rows] = np.stack(
            [np.convolve(column, kernel, mode="same") / weight for column in table.T],
            axis=1,
        ).ravel()
    return made
