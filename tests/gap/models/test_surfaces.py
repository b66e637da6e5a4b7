"""What touches: wheels, feet and floors of a model of one's own."""

from dataclasses import replace

import numpy as np
import pytest

from bns.gap.bench import mjcf_cases
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.model import OwnModel
from tests.sources import ROOT

ARM = ROOT / "examples" / "arm" / "arm.toml"
ROLLER = """
<mujoco model="roller"><option timestep="0.002" integrator="implicitfast"/><worldbody>
  <geom name="floor" type="plane" size="5 5 0.1"/>
  <body name="cart" pos="0 0 0.05"><joint name="along" type="slide" axis="1 0 0"/>
    <joint name="up" type="slide" axis="0 0 1"/><site name="marker"/>
    <geom name="box" type="box" size="0.1 0.05 0.01" mass="1" pos="0 0 0.1"/>
    <body name="wheel"><joint name="axle" axis="0 1 0" damping="0.01"/>
      <geom name="tyre" type="cylinder" size="0.05 0.01" mass="0.2" zaxis="0 1 0"/>
  </body></body></worldbody>
  <actuator><velocity name="motor" joint="axle" kv="0.5"/></actuator></mujoco>"""
ROLLING = """
name = "roller"
model = "roller.xml"
[commands.speed]
actuator = "motor"
unit = "1"
low = -5.0
high = 5.0
[observed.marker]
site = "marker"
axis = "x"
unit = "m"
noise = 1e-3
[observed.axle]
joint = "axle"
unit = "rad"
noise = 1e-3
"""


@pytest.fixture
def roller(tmp_path):
    (tmp_path / "roller.xml").write_text(ROLLER)
    (tmp_path / "own.toml").write_text(ROLLING)
    return OwnModel.read(tmp_path / "own.toml", threads=1)


def test_surfaces_are_considered_where_they_touch(roller):
    told = mjcf_cases.commands(roller, np.random.default_rng(0), 2)
    terms = {row.term for row in roller.rows(mjcf_cases.record(roller, told, []))}
    surfaces = {term for term in terms if term.startswith("geom_")}
    assert surfaces == {
        "geom_radius[tyre]",
        "geom_friction[all]",
        "geom_compliance[all]",
    }
    assert "geom_radius" not in roller.untried()


def test_surfaces_that_touch_nothing_are_said_not_to_be_tried():
    model = OwnModel(replace(OwnConfig.read(ARM), effects=None), threads=1)
    told = mjcf_cases.commands(model, np.random.default_rng(0), 1, seconds=2.0)
    rows = model.rows(mjcf_cases.record(model, told, []))
    assert not any(row.term.startswith("geom_") for row in rows)
    assert {"geom_radius", "geom_friction"} < set(model.untried())


def test_a_larger_wheel_is_found(roller):
    effects = {"geom_radius": ("tyre",), "joint_damping": ("axle",)}
    model = OwnModel(replace(roller.config, effects=effects), threads=1)
    told = mjcf_cases.commands(model, np.random.default_rng(0))
    effect = model.parse("geom_radius:part=tyre,factor=1.03")
    trials = mjcf_cases.record(model, told, [effect], seed=1)
    found = diagnose(trials, model, full=False)
    assert found.verdict.named == (("geom_radius[tyre]",),)
    assert found.best.magnitudes[0] == pytest.approx(1.03, abs=0.003)


def test_slopes_are_taken_by_a_longer_step_where_that_changes_none(roller):
    effects = {
        name: ("axle",)
        for name in ("joint_damping", "joint_friction", "joint_backlash")
    }
    model = OwnModel(replace(roller.config, effects=effects), threads=1)
    told = mjcf_cases.commands(model, np.random.default_rng(0), 2)
    trials = mjcf_cases.record(model, told, [], seed=1)
    moved = [{}, {"joint_damping[axle]": 0.02}, {"joint_backlash[axle]": 0.05}]
    sets = [[values] * len(trials) for values in moved]
    own = np.array(model.paths(trials, sets, fine=False))
    model.stepped(trials, model.rows(trials))
    parts, predicted = set(), model.physics.predicted

    def counted(pairs, cut=1, ahead=None):
        parts.add(cut)
        return predicted(pairs, cut, ahead)

    model.physics.predicted = counted
    longer = np.array(model.paths(trials, sets, fine=False))
    assert parts == {0.5, 1}  # play in a joint is stiff, and keeps the model's step
    change = own[1:] - own[:1]
    assert longer[1:] - longer[:1] == pytest.approx(change, abs=2e-3)
    assert longer[2] - longer[0] == pytest.approx(change[1], abs=1e-12)


@pytest.mark.parametrize(
    ("off", "parts"),
    [
        (lambda cut: 0.0, 1),
        (lambda cut: 0.01 / cut, 4),  # nearer and nearer
        (lambda cut: 0.01 * np.random.default_rng(cut).normal(size=(9, 2)), 1),
    ],
)
def test_steps_are_cut_as_long_as_finer_ones_come_nearer(
    roller, monkeypatch, off, parts
):
    def predicted(pairs, cut=1):
        return [np.zeros((9, 2)) + off(cut) for _ in pairs]

    monkeypatch.setattr(roller.physics, "predicted", predicted)
    assert roller.physics.needed([None]) == parts
