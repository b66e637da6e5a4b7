"""Mass that is added to a body of one's own model, by its moments."""

import mujoco
import numpy as np
import pytest

from bns.gap.decomposition.row import Row
from bns.gap.models.mjcf import masses
from bns.gap.models.mjcf.masses import Body

NAME = "body_mass[load]"
BODY = Body(mass=0.9, gyration=0.11, spread=0.002, whole=0.9)
MODEL = """
<mujoco><worldbody><body name="load">
  <joint name="swing" axis="0 1 0"/>
  <geom type="box" size="0.01 0.02 0.3" pos="0 0 -0.4" mass="0.9"/>
</body></worldbody></mujoco>
"""


def compiled(*effects):
    spec = mujoco.MjSpec.from_string(MODEL)
    for effect in effects:
        effect.edit(spec)
    return spec.compile()


def about_origin(model):
    """Mass, first moment and inertia about the body's own frame, y axis."""
    mass, centre = model.body_mass[1], model.body_ipos[1]
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[1])
    axes = turn.reshape(3, 3)
    inertia = (axes @ np.diag(model.body_inertia[1]) @ axes.T)[1, 1]
    return mass, mass * centre, inertia + mass * (centre[0] ** 2 + centre[2] ** 2)


def test_a_mass_sits_where_its_moments_say():
    values = {NAME: 0.4, f"{NAME}.mz": -0.4 * 0.1}
    made = masses.changes(NAME, values, "load", BODY)
    before, after = about_origin(compiled()), about_origin(compiled(*made))
    assert after[0] - before[0] == pytest.approx(0.4)
    assert (after[1] - before[1])[2] == pytest.approx(0.4 * -0.5)
    assert after[2] - before[2] == pytest.approx(0.4 * 0.5**2)


@pytest.mark.parametrize("mass", [0.0, 0.005])
def test_moments_have_a_slope_where_there_is_no_mass(mass):
    made = masses.changes(NAME, {NAME: mass, f"{NAME}.mx": 0.001}, "load", BODY)
    before, after = about_origin(compiled()), about_origin(compiled(*made))
    assert (after[1] - before[1])[0] == pytest.approx(0.001)


@pytest.mark.parametrize("mass", [-0.8, -0.3, 0.5])
def test_far_moments_leave_a_body_that_can_be(mass):
    values = {NAME: mass, f"{NAME}.mx": 5.0}
    model = compiled(masses.added(NAME, values, "load", Body.of(compiled(), "load")))
    assert model.body_inertia[1].min() > 0


@pytest.mark.parametrize("mass", [-0.3, 0.001, 0.4])
def test_moments_that_a_mass_cannot_have_shift_the_centre(mass):
    body = Body.of(compiled(), "load")
    made = masses.changes(NAME, {NAME: mass, f"{NAME}.mx": 0.4}, "load", body)
    before, after = about_origin(compiled()), about_origin(compiled(*made))
    assert [effect.name for effect in made] == ["body_mass", "body_centre"]
    assert (after[1] - before[1])[0] == pytest.approx(0.4)


def test_a_centre_of_mass_stands_for_a_load_without_mass():
    axis, *_ = masses.centre("load", BODY, "motion")
    assert axis.later and not axis.sloped(0.0) and axis.sloped(0.01)
    values = {NAME: 0.001, f"{NAME}.mx": 0.018}
    found = masses.centred(NAME, values, "load", BODY)
    assert found[axis.name] == pytest.approx(0.02)


def test_mass_and_moments_are_one_explanation_that_covers_a_shifted_centre():
    item = Row(
        name=NAME, effect="body_mass", parameter="added", unit="kg", nominal=0.0,
        sd=0.1, low=-0.8, high=1.8, levels=(0.1,), fixed={"part": "load"},
    )  # fmt: skip
    rows = masses.rows(item, BODY, "motion")
    assert [row.name for row in rows] == [NAME, *(f"{NAME}.m{a}" for a in "xyz")]
    assert {row.term for row in rows} == {NAME}
    assert rows[0].covers == tuple(f"body_centre.d{a}[load]" for a in "xyz")


def test_a_load_may_sit_on_what_is_fixed_to_a_body():
    text = """<mujoco><worldbody><body name="boom"><joint axis="0 0 1"/>
      <inertial pos="0.5 0 0" mass="0.3" diaginertia="1e-9 0.025 0.025"/>
      <body name="trunk" pos="1 0 0">
        <inertial pos="0 0 0" mass="1.2" diaginertia="1e-3 1e-3 1e-3"/>
        <body name="leg"><joint axis="0 1 0"/>
          <inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/></body></body>
      </body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    body = Body.of(model, "boom")
    turned = 0.025 + 1e-3 + 1.2 * 0.5**2
    assert (body.mass, body.whole) == pytest.approx((0.3, 1.5))
    assert body.gyration == pytest.approx(np.sqrt(turned / 1.5))
    leg = Body.of(model, "leg")
    assert (leg.mass, leg.whole, leg.gyration) == pytest.approx((9, 9, 1 / 3))
