"""The hexapod's model: kinematics, servos, masses, against answers known elsewhere."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import BnsError, OutOfBoundsError
from bns.models import ax12a, legs, servo_pendulum
from bns.models.phantomx import gait, kinematics, servos
from bns.worlds.physics import servo_law

# What one robot of the maker held as its neutral pose (NUKE, ik_neutral), by identity.
NEUTRAL = (
    *(655, 366, 500, 518, 660, 366, 350, 653, 501),
    *(520, 656, 364, 511, 511, 503, 518, 660, 366),
)


@pytest.fixture(scope="module")
def model():
    return models.spec("phantomx", visuals=False).compile()


def test_feet_are_where_the_model_has_them(model):
    rng = np.random.default_rng(1)
    low, high = models.robot("phantomx").ranges.T
    data = mujoco.MjData(model)
    for goals in rng.uniform(low, high, (5, 18)):
        data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
        data.qpos[7:] = goals
        mujoco.mj_kinematics(model, data)
        seen = [data.site(f"{leg}_foot").xpos for leg in legs.LEGS]
        np.testing.assert_allclose(kinematics.feet(goals), seen, atol=1e-6)


def test_the_belly_touches_with_the_corners_of_its_box(model):
    size = model.geom("belly").size
    belly = kinematics.contacts(np.zeros(18))[6:]
    np.testing.assert_allclose(np.abs(belly), np.tile(size, (4, 1)))
    assert (belly[:, 2] < 0).all() and len({tuple(row) for row in belly}) == 4


def test_inverse_kinematics_undoes_the_forward_one():
    rng = np.random.default_rng(2)
    low, high = models.robot("phantomx").ranges.T
    goals = rng.uniform(low / 4, high / 4, (50, 18))
    np.testing.assert_allclose(kinematics.goals(kinematics.feet(goals)), goals)
    with pytest.raises(BnsError, match=r"0\.067 to 0\.199 m"):
        kinematics.goals(kinematics.feet(np.zeros(18)) * 2)


def test_half_way_is_the_pose_of_the_makers_numbers():
    feet = kinematics.feet(np.zeros(18))
    shape = kinematics.shape()
    np.testing.assert_allclose(
        np.degrees(shape.heading[[0, 2, 4]]), [42.1, -42.1, 0], 1
    )
    assert np.degrees(shape.femur_zero) == pytest.approx(-3.5, abs=0.05)
    assert 180 + np.degrees(shape.knee_zero) == pytest.approx(136.2, abs=0.1)
    assert feet[:, 2] == pytest.approx(-0.1015, abs=5e-4)
    np.testing.assert_allclose(feet[::2, 1], -feet[1::2, 1])


def test_the_makers_neutral_pose_is_nearly_symmetric():
    by_joint = np.array([NEUTRAL[servos.IDS[joint] - 1] for joint in legs.JOINTS])
    goals = servos.goals(by_joint).reshape(6, 3)
    np.testing.assert_allclose(goals[::2], goals[1::2], atol=22 * ax12a.UNIT)
    np.testing.assert_allclose(goals[:, 1], goals[0, 1], atol=18 * ax12a.UNIT)
    # There the femur is level, the knee at a right angle, all legs lateral: the foot is
    # 118 mm to the side of the hip, a tibia's length below it.
    shape, feet = kinematics.shape(), kinematics.feet(goals.ravel())
    assert feet[:, 2] == pytest.approx(-shape.tibia, abs=0.003)
    away = np.abs(feet[:, :2] - shape.hips)
    assert away[:, 1] == pytest.approx(0.118, abs=0.01)
    assert away[:, 0] == pytest.approx(0.0, abs=0.02)
    assert (servos.registers(goals.ravel()) == by_joint).all()


def test_identities_and_signs():
    assert sorted(servos.IDS.values()) == list(range(1, 19))
    assert servos.IDS["left_front_coxa"] == 1 and servos.IDS["right_middle_tibia"] == 18
    assert servos.registers(np.zeros(18)).tolist() == [512] * 18
    up = servos.registers(np.full(18, 0.1))
    assert up[1] < 512 < up[4]  # left and right femur
    names = [command.name for command in models.robot("phantomx").commands]
    assert names == list(legs.JOINTS)


def test_masses_add_up(model):
    assert model.body_mass.sum() == pytest.approx(2.2296)
    assert model.body_mass.sum() > 18 * 0.0546  # more than its servos


def test_the_joints_hold_the_servo_law(model):
    law = ax12a.law()
    servo_law.law(law)  # every number, inside its bounds
    numbers = servo_law.joint_numbers(law)
    assert numbers.torque_limit == pytest.approx(1.5 * 11.1 / 12, rel=1e-3)
    joint, actuator = model.joint("left_rear_femur"), model.actuator("left_rear_femur")
    assert actuator.gainprm[0] == pytest.approx(numbers.stiffness, rel=1e-4)
    assert actuator.biasprm[1] == pytest.approx(-numbers.stiffness, rel=1e-4)
    assert actuator.forcerange[1] == pytest.approx(numbers.torque_limit, rel=1e-4)
    assert joint.damping[0] == pytest.approx(numbers.damping, rel=1e-3)
    assert joint.frictionloss[0] == numbers.friction
    assert joint.armature[0] == numbers.armature


def test_no_load_speed_and_stall_are_the_data_sheets():
    numbers = servo_law.joint_numbers({**ax12a.law(), "voltage": 12.0})
    assert numbers.torque_limit == pytest.approx(1.5, rel=1e-3)
    free = (numbers.torque_limit - numbers.friction) / numbers.damping
    assert free == pytest.approx(ax12a.NO_LOAD_SPEED, rel=0.01)


def test_uncertain_numbers_lie_between_their_ends():
    law, ends = ax12a.law(), ax12a.uncertain()
    assert {"coulomb", "armature", "torque_constant"} <= set(ends)
    assert all(low <= law[name] <= high for name, (low, high) in ends.items())
    assert set(law) == set(servo_pendulum.law())


def test_registers_and_angles():
    assert np.degrees(ax12a.UNIT) == pytest.approx(0.2933, abs=1e-4)
    assert ax12a.units(np.array([0.0, np.pi / 2])).tolist() == [512, 819]
    assert ax12a.angle(ax12a.units(0.3)) == pytest.approx(0.3, abs=ax12a.UNIT / 2)


def test_tripod_keeps_inside_the_stops_and_lifts_three_legs():
    goals = gait.tripod()
    low, high = models.robot("phantomx").ranges.T
    assert ((goals >= low) & (goals <= high)).all()
    heights = kinematics.feet(goals)[:, :, 2]
    assert ((heights[::2] > -gait.BEST.height + 0.01).sum(axis=1) == 3).all()
    np.testing.assert_allclose(heights[1::2], -gait.BEST.height)
    with pytest.raises(OutOfBoundsError, match="tripod: command 0: left_rear_femur"):
        gait.tripod(gait.Tripod(stride=0.04, lift=0.06, reach=0.13, height=0.1))
    with pytest.raises(BnsError, match="from its femur axis"):
        gait.tripod(gait.Tripod(reach=0.3))
