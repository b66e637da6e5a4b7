"""What a decomposition says where explanations bend to something else."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.decomposition import fit
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
    ("exact", "recurs", "scatter", "lasting"),
    [
        (0.01, 4.0, 0.0, False),  # the model is believed to a hundredth of the motion
        (0.005, 4.0, 0.0, True),
        (0.005, 4.0, 60.0, False),  # repeats differ by as much
        (0.005, 0.0, 50.0, False),
    ],
)
def test_what_recurs_is_weighed_by_how_exact_a_model_is(
    exact, recurs, scatter, lasting
):
    made = SimpleNamespace(
        problem=SimpleNamespace(model=SimpleNamespace(inexact=exact), trials=()),
        broken=False,
        after=53.0,
        moved=1e6,
        scatter=scatter,
        recurring=recurs > 3,
    )
    assert Decomposition.lasting.fget(made) is lasting


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
