"""Candidates are simulated where they do about as much as a recording departs."""

from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.candidates.legged import candidates
from bns.gap.core import adaptive_grid, fit, signatures, support, verdict
from bns.gap.models.legged.where import Suspects

(GRIP,) = (
    item
    for item in candidates(Suspects((), (), True))
    if item.name == "foot_slippery[all]"
)


class Turning:
    """A recording of a robot whose signature goes round as its grip grows."""

    model = SimpleNamespace(winding=True)

    def __init__(self, factor: float):
        self.rest, self.asked = self._shown(factor), []

    def _shown(self, factor: float) -> np.ndarray:
        off = factor - 1.0
        return 200.0 * off * np.array([np.cos(4 * off), np.sin(4 * off)])

    def signatures(self, effects, *, rough=False):
        factors = [effect["factor"] for (effect,) in effects]
        self.asked += factors
        rows = np.array([self._shown(factor) for factor in factors])
        rows[np.array(factors) < 0.2] = np.nan  # diverged
        return rows


@pytest.mark.parametrize("factor", [1.02, 1.15, 1.5, 0.6])
def test_a_magnitude_near_the_true_one_is_simulated(factor):
    problem = Turning(factor)
    curves = signatures.trace(problem, [GRIP])
    gap = np.linalg.norm(curves.signature - problem.rest, axis=1).min()
    assert gap < 0.5 * np.linalg.norm(problem.rest)


def test_what_does_far_more_than_the_recording_shows_is_left_out():
    strong = (0.1, 0.5, 1.3, 1.7)
    problem = Turning(1.05)
    item = SimpleNamespace(
        grid=strong,
        nominal=1.0,
        branches=({},),
        make=GRIP.make,
        name=GRIP.name,
        whole=False,
    )
    adaptive_grid.simulated(problem, [item])
    assert 1.3 in problem.asked
    assert 1.7 not in problem.asked
    assert len(problem.asked) <= len(strong) + 2 * adaptive_grid.TRIES


def test_what_diverges_is_told_and_does_not_count():
    found, diverged = adaptive_grid.simulated(Turning(1.5), [GRIP])
    assert [value for value, _ in found[0, 0] if value < 0.2] == []
    assert len(diverged) == 1
    assert "foot_slippery" in diverged[0]


def test_a_fit_looks_beyond_the_minimum_it_ends_in():
    problem = Turning(1.3)
    start = [fit.Term.at(GRIP, 0, 0.9)]
    found = fit.refine(problem, start)
    problem.model = SimpleNamespace(winding=False)
    assert found.loss < 0.5 * fit.refine(problem, start).loss


@pytest.mark.parametrize(
    ("factor", "left", "gap"),
    [
        (1.15, 0.5, False),  # as the grip of a sound robot may be
        (1.5, 0.5, True),
        (1.15, 1e-6, True),  # something else is there besides
    ],
)
def test_what_the_model_is_unsure_of_is_no_gap(factor, left, gap):
    rest = np.array([1.0, -1.0])
    nothing = support.Point((), 9 * rest, 400.0, rest)
    single = support.Point((support.Term.at(GRIP, 0, factor),), rest, 100.0, rest)
    search = SimpleNamespace(nothing=nothing, best=lambda size: single)
    null = SimpleNamespace(p_gain=lambda gain: 1e-5)
    found = [SimpleNamespace(p_misfit=p) for p in (0.5, left)]
    problem = SimpleNamespace(
        model=SimpleNamespace(features=(0, 1)),
        floor=SimpleNamespace(source="model", sigma=()),
    )
    assert (verdict.chance(problem, search, null, found) < 0.005) == gap
