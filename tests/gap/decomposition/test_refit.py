"""Gauss-Newton steps on a problem whose answer is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.decomposition import refit
from bns.gap.decomposition.row import Row

TRUE = 40.0  # plausible departures: a load on a light hand
SHAPE = np.ones((50, 1))


def noise(weight=1e4):
    """Noise that makes a residual count so much."""
    return SimpleNamespace(
        lam=1.0,
        loss=lambda rest: float((rest**2).sum()) * weight,
        weights=lambda rest, seen: weight * SHAPE,
        innovations=lambda values: values,
    )


def load(slope=1.0, *, one_step=False):
    """A problem whose prediction is the value of its one row; by the coarse step, if
    there is one, it is so many times as large."""
    row, asked = Row("load", 0.0, 1.0, -100.0, 100.0), []

    def residual(values):
        asked.append(values[0])
        return (TRUE - values[0]) * SHAPE, None

    return asked, SimpleNamespace(
        model=SimpleNamespace(one_step=one_step),
        rows=(row,),
        terms={"load": (0,)},
        nominal=np.zeros(1),
        sd=np.ones(1),
        bounds=(np.array([row.low]), np.array([row.high])),
        seen=SHAPE > 0,
        slopes=lambda values, which, only: {0: slope * SHAPE},
        predict=lambda sets, fine, only: [slope * v[0] * SHAPE for v in sets],
        residual=residual,
    )


def test_a_load_many_times_what_its_link_departs_by_is_reached_in_few_steps():
    _, problem = load()
    begun = np.array([10.0])  # as a tangent at the nominal model has it
    values, _ = refit.newton(problem, begun, {"load"}, noise(), turns=refit.STEPS)
    assert values[0] == pytest.approx(TRUE, rel=1e-3)


def test_steps_are_judged_by_the_coarse_step_and_their_end_by_the_fine_one():
    asked, problem = load(1.01)
    values, rest = refit.newton(
        problem, np.array([10.0]), {"load"}, noise(), turns=refit.STEPS
    )
    assert asked == [10.0, values[0]]
    np.testing.assert_allclose(rest, (TRUE - values[0]) * SHAPE)


def test_where_the_coarse_step_leads_astray_the_fine_one_judges_each_step():
    asked, problem = load(0.1)  # ten times as far as it should be
    begun = np.array([TRUE - 1.0])
    values, _ = refit.newton(problem, begun, {"load"}, noise(100.0), turns=refit.STEPS)
    assert len(asked) > 3
    assert abs(values[0] - TRUE) < 1.0


def test_a_model_of_one_step_is_asked_for_no_other():
    _, problem = load(one_step=True)
    problem.predict = None
    values, _ = refit.newton(
        problem, np.array([10.0]), {"load"}, noise(), turns=refit.STEPS
    )
    assert values[0] == pytest.approx(TRUE, rel=1e-3)
