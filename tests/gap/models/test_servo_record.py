"""A servo's runs against unchanged ones, from trials to a written diagnosis."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.gap.models.servo import diagnosis
from bns.gap.models.servo.model import ServoModel
from bns.gap.planning import plan
from bns.gap.records import Diagnosis
from bns.worlds.effects import registry

CELLS = [(m, 0.1, k) for m in (0.4, 0.6, 0.8) for k in (8.0, 16.0)]
DRIVES = ("slow sweep, there and back", "lift, then let fall with the motor off")
USUAL = ("servo_coulomb:torque=0.02", "servo_viscous:coefficient=0.01")


def drive(model, cell, seed, *effects):
    told = dict(zip(("mass", "lever", "gain"), cell, strict=True))
    made, rng = [], np.random.default_rng(seed)
    for item in model.excitations(told=told):
        if item.name not in DRIVES:
            continue
        blank = plan.blank(item.commands, model, "", told)
        ((angles,),) = model.simulate([blank], [effects])
        noisy = angles + rng.normal(0, 1e-3, angles.shape)
        known = {**told, "trajectory": item.name}
        made.append(blank.replace(observed=noisy, conditions=known))
    return made


@pytest.fixture(scope="module")
def model():
    return ServoModel()


@pytest.fixture(scope="module")
def usual():
    return [registry.parse(text) for text in USUAL]


@pytest.fixture(scope="module")
def unchanged(model, usual):
    rows = [drive(model, cell, n, *usual) for n, cell in enumerate(CELLS)]
    return [trial for row in rows for trial in row]


def test_a_payload_is_named_beside_unchanged_runs(model, usual, unchanged):
    heavier = registry.parse("servo_payload:mass=0.15")
    mine = drive(model, CELLS[0], 50, *usual, heavier)
    found = diagnosis.record(mine, [*unchanged, *mine], nominal=model.nominal)
    assert found.verdict.kind in ("effect", "either")
    assert ("servo_payload",) in found.verdict.named
    fit = next(fit for fit in found.fits if fit.names == ("servo_payload",))
    assert fit.magnitudes[0] == pytest.approx(0.15, abs=0.02)
    assert fit.intervals[0][0] <= fit.magnitudes[0] <= fit.intervals[0][1]
    assert Diagnosis.from_json(found.to_json()).verdict.named == found.verdict.named


def test_what_is_missing_is_said(model, unchanged):
    mine = drive(model, CELLS[0], 50)
    bare = [trial.replace(conditions={"mass": 0.4}) for trial in mine]
    with pytest.raises(BnsError, match="lever, gain, trajectory"):
        diagnosis.record(bare, unchanged)
    with pytest.raises(BnsError, match="No unchanged recording"):
        diagnosis.record(mine, mine)
