"""Gauss-Newton steps on a problem whose answer is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.decomposition import refit
from bns.gap.decomposition.row import Row

TRUE = 40.0  # plausible departures: a load on a light hand


def test_a_load_many_times_what_its_link_departs_by_is_reached_in_few_steps():
    shape, row = np.ones((50, 1)), Row("load", 0.0, 1.0, -100.0, 100.0)
    problem = SimpleNamespace(
        rows=(row,),
        terms={"load": (0,)},
        nominal=np.zeros(1),
        sd=np.ones(1),
        bounds=(np.array([row.low]), np.array([row.high])),
        seen=shape > 0,
        slopes=lambda values, which, only: {0: shape},
        residual=lambda values: ((TRUE - values[0]) * shape, None),
    )
    noise = SimpleNamespace(
        lam=1.0,
        loss=lambda rest: float((rest**2).sum()) * 1e4,
        weights=lambda rest, seen: 1e4 * shape,
        innovations=lambda values: values,
    )
    begun = np.array([10.0])  # as a tangent at the nominal model has it
    values, _ = refit.newton(problem, begun, {"load"}, noise, turns=refit.STEPS)
    assert values[0] == pytest.approx(TRUE, rel=1e-3)
