"""What a decomposition says where explanations bend to something else."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.decomposition import fit, sizes
from bns.gap.decomposition.decomposition import Decomposition
from bns.gap.decomposition.row import Row

ROWS = (
    Row("axle", 1.0, 0.04, 0.7, 1.3),
    Row("stiction", 0.0, 0.003, 0.0, 0.03, inexact=0.05),
)


def problem():
    bounds = tuple(np.array([getattr(row, k) for row in ROWS]) for k in ("low", "high"))
    nominal, sd = (np.array([getattr(r, k) for r in ROWS]) for k in ("nominal", "sd"))
    return SimpleNamespace(rows=ROWS, bounds=bounds, nominal=nominal, sd=sd)


@pytest.mark.parametrize(
    ("axle", "left", "strained"),
    [
        (0.7, 0.2, True),  # at the edge of what is possible, and much is left
        (0.7, 0.05, False),
        (0.9, 0.2, False),
    ],
)
def test_explanations_that_bend(axle, left, strained):
    point = SimpleNamespace(support={"axle"}, values=np.array([axle, 0.0]))
    made = SimpleNamespace(
        problem=problem(), point=point, lasting=True, unexplained=left
    )
    assert Decomposition.strained.fget(made) is strained


@pytest.mark.parametrize(
    ("recurs", "scatter", "support", "foreign"),
    [
        (3.9, 35.0, (), True),  # repeats differ, and a third of it recurs
        (3.9, 51.5, (), False),
        (0.0, 35.0, (), False),
        (3.9, 35.0, ("axle",), False),
        (3.9, 20.0, ("axle",), True),
    ],
)
def test_what_recurs_of_an_unexplained_gap_is_of_no_library(
    recurs, scatter, support, foreign
):
    made = SimpleNamespace(
        point=SimpleNamespace(support=support),
        lasting=True,
        recurring=recurs > 3,
        after=53.0,
        scatter=scatter,
        unexplained=(53.0 - scatter) / 53.0,
        **dict.fromkeys(
            ("unconfirmed", "failing", "strained", "goes", "elsewhere"), ""
        ),
    )
    assert Decomposition.foreign.fget(made) is foreign


def test_how_exact_a_fit_is_goes_by_its_least_exact_explanation():
    assert fit.inexact(problem(), np.array([0.9, 0.0])) == 0.01
    assert fit.inexact(problem(), np.array([0.9, 1e-4])) == 0.01
    assert fit.inexact(problem(), np.array([0.9, 0.004])) == 0.05


@pytest.mark.parametrize(("shift", "there"), [(0.7, False), (0.9, True), (1.3, False)])
def test_a_shift_in_time_that_is_at_its_bound_can_do_no_more(shift, there):
    rows = (replace(ROWS[0], nuisance=True), ROWS[1])
    made = SimpleNamespace(rows=rows)
    assert fit.smooth(made, np.array([shift, 0.0])) == ([0, 1] if there else [1])
    assert fit.smooth(problem(), np.array([shift, 0.0])) == [0, 1]  # an explanation


@pytest.mark.parametrize(("error", "worse"), [(99.0, False), (101.0, True)])
def test_what_foretells_worse_than_the_nominal_model_explains_nothing(
    monkeypatch, error, worse
):
    held = SimpleNamespace(compared=lambda rest, support: (100.0, error))
    monkeypatch.setattr(sizes.HeldOut, "of", lambda *given: held)
    start, point = SimpleNamespace(rest=None), SimpleNamespace(support={"axle"})
    size = SimpleNamespace(inside=None)
    tells = sizes.Sizes.foretells_worse
    assert tells(size, problem(), start, point) is worse
