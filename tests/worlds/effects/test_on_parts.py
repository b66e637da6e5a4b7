"""Effects on parts of any model, against answers that are known beforehand."""

import mujoco
import numpy as np
import pytest

from bns.errors import BnsError, UnknownNameError
from bns.worlds.effects import registry
from tests.worlds.effects.subjects import at_rest, built

G = 9.81  # [m/s2]
ROD = """
<mujoco><option timestep="0.001"/><worldbody><body name="rod">
  <joint name="pivot" axis="0 1 0"/>
  <inertial pos="0.2 0 0" mass="0.6" diaginertia="1e-9 8e-3 8e-3"/>
  <site name="end" pos="0.4 0 0"/>
</body></worldbody>
<actuator><position name="servo" joint="pivot" kp="20" kv="2"/></actuator></mujoco>
"""
"""A thin rod of 0.6 kg and 0.4 m that hangs on one end; inertia m L^2 / 12."""


def moving(model, speed, seconds=1.0) -> mujoco.MjData:
    """While every joint is kept at a speed [rad/s]."""
    data = mujoco.MjData(model)
    for _ in range(round(seconds / model.opt.timestep)):
        data.qvel[:] = speed
        mujoco.mj_step(model, data)
    data.qvel[:] = speed
    mujoco.mj_forward(model, data)
    return data


class TestJoints:
    def test_a_spring_shares_the_servos_angle(self):
        model = built("joint_stiffness:part=elbow,added=4", gravity=False)
        assert at_rest(model).qpos == pytest.approx(
            [0.5, 0.3 * 12 / (12 + 4)], abs=1e-3
        )

    def test_stribeck_friction_fades_with_speed(self):
        model = built("joint_stribeck:part=pivot,torque=0.5,speed=0.2", xml=ROD)
        for speed in (0.02, 0.1, 0.2, 0.4):
            force = moving(model, speed).actuator_force[-1]
            expected = 0.5 * (1e-3 + (1 - 1e-3) * np.exp(-((speed / 0.2) ** 2)))
            assert force == pytest.approx(-expected, rel=0.01)

    def test_stribeck_friction_holds_until_it_breaks_away(self):
        model = built(
            "joint_stribeck:part=pivot,torque=0.5,speed=0.2", xml=ROD, gravity=False
        )
        model.actuator_gainprm[0] = model.actuator_biasprm[0] = 0
        for share, moves in ((0.95, False), (1.05, True)):
            data = mujoco.MjData(model)
            for step in range(2000):
                data.qfrc_applied[0] = share * 0.5 * min(1.0, step / 1000)
                mujoco.mj_step(model, data)
            assert (data.qpos[0] > 0.1) == moves

    def test_a_keyframe_still_fits_a_model_with_more_joints_and_actuators(self):
        model = built(
            "joint_backlash:part=shoulder,play=0.1", "joint_stribeck:torque=1"
        )
        assert model.key_qpos[0] == pytest.approx([0.6, 0, 0.9])
        assert model.key_ctrl[0][:2] == pytest.approx([0.6, 0.9])
        assert model.nu == model.key_ctrl.shape[1] > 2

    def test_backlash_lets_the_load_hang_on_its_stop(self):
        model = built("joint_backlash:part=elbow,play=0.1")
        data = at_rest(model, seconds=6.0)
        shaft, play = data.joint("elbow").qpos[0], data.joint("elbow_play").qpos[0]
        assert play == pytest.approx(0.05, abs=2e-3)  # down is positive
        plain = at_rest(built(), seconds=6.0)
        assert shaft == pytest.approx(plain.joint("elbow").qpos[0], abs=5e-3)
        assert model.joint("elbow_play").range == pytest.approx([-0.05, 0.05])

    def test_play_before_an_encoder_is_told_by_its_name(self):
        model = built("output_backlash:part=elbow,play=0.1")
        assert model.joint("elbow_seen_play").range == pytest.approx([-0.05, 0.05])

    def test_an_encoder_that_reads_too_much_stops_the_arm_short(self):
        off = built("encoder_offset:part=elbow,added=0.1", gravity=False)
        plain = built(gravity=False)
        there = at_rest(off, (0.5, 0.4))
        assert there.qpos == pytest.approx([0.5, 0.4], abs=1e-3)  # what it reports
        short = at_rest(plain, (0.5, 0.3))  # where it is
        assert there.site("hand").xpos == pytest.approx(
            short.site("hand").xpos, abs=1e-3
        )

    def test_end_stops_stay_on_the_robot_in_a_file_in_degrees(self):
        off = built("encoder_offset:part=shoulder,added=0.1")
        stops = np.deg2rad([-170, 170]) + 0.1
        assert off.joint("shoulder").range == pytest.approx(stops)


LINKAGE = """<mujoco><default><geom type="capsule" size="0.01" contype="0"/></default>
  <worldbody><body name="left" pos="-0.1 0 0"><joint axis="0 1 0"/>
    <geom fromto="0 0 0 0 0 -0.3"/><body name="bar" pos="0 0 -0.3">
    <joint axis="0 1 0"/><geom fromto="0 0 0 0.2 0 0"/></body></body>
  <body name="right" pos="0.1 0 0"><joint axis="0 1 0"/>
    <geom fromto="0 0 0 0 0 -0.3"/></body></worldbody>
  <equality><connect name="loop" body1="bar" body2="right" anchor="0.2 0 0"/></equality>
  </mujoco>"""


class TestBodies:
    def test_a_longer_rod_is_harder_to_turn_by_the_square(self):
        plain, long = (
            built(*texts, xml=ROD)
            for texts in ([], ["body_length:part=rod,factor=1.2"])
        )
        assert plain.dof_M0[0] == pytest.approx(0.6 * 0.4**2 / 3)
        assert long.dof_M0[0] == pytest.approx(0.6 * 0.48**2 / 3)
        assert long.site("end").pos == pytest.approx([0.48, 0, 0])
        assert long.body("rod").mass == plain.body("rod").mass

    def test_a_longer_upper_arm_carries_the_forearm_further_out(self):
        long = built("body_length:part=upper_arm,factor=1.1")
        assert long.body("forearm").pos == pytest.approx([0.33, 0, 0])
        capsule = long.geom("upper_arm")
        assert capsule.size[1] == pytest.approx(0.165)
        assert capsule.pos == pytest.approx([0.165, 0, 0])

    def test_a_longer_link_of_a_loop_opens_it_at_its_own_end(self):
        long = built("body_length:part=bar,factor=1.2", xml=LINKAGE)
        ends = [long.site(f"loop0_end{end}").pos for end in range(2)]
        assert ends[0] == pytest.approx([0.24, 0, 0])
        assert ends[1] == pytest.approx([0, 0, -0.3])
        assert long.neq == 1

    def test_a_tilted_body_is_one_in_tilted_gravity(self):
        tilted = built("body_tilt:part=rod,roll=0.3,pitch=-0.2", xml=ROD)
        level = built(xml=ROD)
        turn, gravity = np.zeros(4), np.zeros(3)
        mujoco.mju_axisAngle2Quat(
            turn, np.array([0.3, -0.2, 0]) / np.hypot(0.3, 0.2), -np.hypot(0.3, 0.2)
        )
        mujoco.mju_rotVecQuat(gravity, np.array([0, 0, -G]), turn)
        level.opt.gravity = gravity
        one, other = at_rest(tilted), at_rest(level)
        assert one.qpos == pytest.approx(other.qpos, abs=1e-9)
        assert abs(one.qpos[0] - 0.5) > 1e-3

    @pytest.mark.parametrize("part", ["rod", "all"])
    def test_what_carries_half_of_a_weight_leaves_half_of_its_torque(self, part):
        xml = ROD.replace('name="rod"', 'name="rod" gravcomp="0.8"')
        model = built(f"gravity_compensation:part={part},added=-0.3", xml=xml)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        held = data.qfrc_bias[0] - data.qfrc_gravcomp[0]
        assert abs(held) == pytest.approx(0.5 * 0.6 * G * 0.2)

    def test_a_centre_of_mass_further_out_pulls_harder(self):
        def pull(*texts):
            model = built(*texts, xml=ROD)
            data = mujoco.MjData(model)
            mujoco.mj_forward(model, data)
            return abs(data.qfrc_bias[0])

        assert pull() == pytest.approx(0.6 * G * 0.2)
        assert pull("body_centre:part=rod,dx=0.05") == pytest.approx(0.6 * G * 0.25)
        assert pull("body_centre:part=rod,dy=0.05") == pytest.approx(0.6 * G * 0.2)

    def test_mass_pulls_and_friction_scales(self):
        model = built("body_mass:part=forearm,added=0.1", "geom_friction:factor=0.5")
        assert model.body("forearm").mass == pytest.approx(0.5)
        assert model.geom_friction[:, 0] == pytest.approx(0.5)  # of 1


ROLLER = """
<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<geom name="floor" type="plane" size="5 5 0.1"/>
<body name="cart" pos="0 0 0.05"><joint type="slide" axis="1 0 0"/>
  <joint type="slide" axis="0 0 1"/><geom type="box" size="0.1 0.05 0.01" mass="1"
  contype="0" conaffinity="0"/><body name="wheel"><joint name="axle" axis="0 1 0"/>
  <geom name="tyre" type="{}" mass="0.2" zaxis="0 1 0"/></body></body></worldbody>
<actuator><velocity name="motor" joint="axle" kv="5"/></actuator></mujoco>
"""
"""A cart on one wheel of 50 mm, which cannot fall over."""
TYRES = (
    'cylinder" size="0.05 0.01',
    'sphere" size="0.05',
    'ellipsoid" size=".05 .05 .05',
)


class TestSurfaces:
    @pytest.mark.parametrize("tyre", TYRES)
    def test_a_larger_wheel_rolls_farther_and_weighs_the_same(self, tyre):
        xml = ROLLER.format(tyre)
        plain, large = built(xml=xml), built("geom_radius:factor=1.2", xml=xml)
        assert large.body_mass == pytest.approx(plain.body_mass)
        for one, other in zip(large.body_inertia, plain.body_inertia, strict=True):
            assert sorted(one) == pytest.approx(sorted(other))
        speeds = [at_rest(model, (2.0,)).qvel[0] for model in (plain, large)]
        assert speeds == pytest.approx([0.05 * 2.0, 0.06 * 2.0], rel=0.02)

    def test_a_box_has_no_radius(self):
        xml = ROLLER.format('box" size="0.05 0.05 0.05')
        with pytest.raises(BnsError, match="not round"):
            built("geom_radius:part=tyre,factor=1.2", xml=xml)

    @pytest.mark.parametrize("floor", ["", ' friction="0.7"', ' priority="2"'])
    def test_a_tyre_alone_is_slippery_on_a_floor_that_grips(self, floor):
        xml = ROLLER.format('sphere" size="0.05" friction="0.5')
        xml = xml.replace('0.1"/>', f'0.1"{floor}/>')
        grips = []
        for texts in ([], ["geom_friction:part=tyre,factor=0.2"]):
            model = built(*texts, xml=xml)
            data = at_rest(model, (0.0,))
            grips += [float(data.contact.friction[0, 0])]
        assert grips[1] == pytest.approx(0.2 * grips[0])

    def test_a_soft_floor_lets_sink_in(self):
        depths = []
        for solref in ("0.02 1", "-2500 -100"):  # the same, written in two ways
            xml = ROLLER.format(f'sphere" size="0.05" solref="{solref}')
            xml = xml.replace('0.1"/>', f'0.1" solref="{solref}"/>')
            for texts in ([], ["geom_compliance:factor=2"]):
                depths.append(-at_rest(built(*texts, xml=xml), (0.0,)).qpos[1])
        assert depths[2:] == pytest.approx(depths[:2])
        assert 2 < depths[1] / depths[0] < 4  # the contact stiffens as it sinks in


class TestActuators:
    def test_a_softer_servo_gives_way_more(self):
        droop = [
            at_rest(built(*texts, xml=ROD), (0.0,)).qpos[0]
            for texts in ([], ["actuator_kp:factor=0.5"])
        ]
        for angle, kp in zip(droop, (20, 10), strict=True):
            assert kp * angle == pytest.approx(0.6 * G * 0.2 * np.cos(angle), rel=1e-3)

    def test_the_gain_on_speed_is_scaled_alone(self):
        for texts, kd in (([], 2.0), (["actuator_kd:part=servo,factor=0.5"], 1.0)):
            model = built(*texts, xml=ROD)
            data = mujoco.MjData(model)
            data.qvel[0], data.qpos[0], data.ctrl[0] = 3.0, 0.1, 0.1
            mujoco.mj_forward(model, data)
            assert data.actuator_force[0] == pytest.approx(-3 * kd)

    def test_a_larger_wheel_goes_farther_a_turn_and_pushes_less(self):
        servo = '<velocity name="a" joint="knee" kv="9" gear="20"/>'
        gear = ["actuator_gear:part=a,factor=0.8"]
        for texts, ratio in (([], 20.0), (gear, 16.0)):
            model = built(*texts, xml=LOOP.format(servo), gravity=False)
            data = mujoco.MjData(model)
            data.ctrl[0] = 4.0
            mujoco.mj_forward(model, data)
            assert data.qfrc_actuator[0] == pytest.approx(9 * 4 * ratio)
            mujoco.mj_step(model, data, 2000)
            assert data.qvel[0] == pytest.approx(4 / ratio, rel=1e-3)

    @pytest.mark.parametrize("force", ['force="50"', 'scale="200"'])
    def test_a_muscle_pulls_so_much_less_all_along(self, force):
        xml = LOOP.format(f'<muscle joint="knee" lengthrange="-2 2" {force}/>')
        pulls = []
        for texts in ([], ["actuator_gain:factor=0.8"]):
            model = built(*texts, xml=xml)
            data = mujoco.MjData(model)
            for angle, activation in ((-0.5, 0.3), (0.0, 1.0), (1.5, 0.0)):
                data.qpos[0], data.act[0] = angle, activation
                data.qvel[0] = angle
                mujoco.mj_forward(model, data)
                pulls.append(data.actuator_force[0])
        assert np.array(pulls[3:]) == pytest.approx(0.8 * np.array(pulls[:3]))
        assert min(np.abs(pulls)) > 0.001  # all three are felt

    def test_a_limited_servo_pushes_no_harder(self):
        model = built("actuator_torque_limit:part=shoulder_servo,factor=0.25")
        data = mujoco.MjData(model)
        data.ctrl[:] = 2.5
        mujoco.mj_forward(model, data)
        assert data.actuator_force == pytest.approx([2.0, 4.0])

    def test_what_an_actuator_lacks_is_said(self):
        bare = ROD.replace(' kv="2"', "")
        with pytest.raises(BnsError, match=r"'servo' has no damping gain"):
            built("actuator_kd:factor=2", xml=bare)
        with pytest.raises(BnsError, match="no force range"):
            built("actuator_torque_limit:factor=0.5", xml=bare)


class TestParts:
    def test_all_a_pattern_and_a_name(self):
        gains = [
            built(f"actuator_gain:part={part},factor=0.5").actuator_gainprm[:, 0]
            for part in ("all", "*_servo", "elbow_*", "elbow_servo")
        ]
        assert np.array(gains).tolist() == [[15, 6], [15, 6], [30, 6], [30, 6]]

    def test_an_unknown_one_gets_a_suggestion(self):
        with pytest.raises(UnknownNameError, match="Did you mean 'elbow'"):
            built("joint_damping:part=elbwo,added=1")

    def test_former_names_are_read_and_light_sensors_keep_theirs(self):
        old = registry.parse("sensor_gain:part=elbow,factor=1.5")
        assert str(old) == "reading_gain:part=elbow,factor=1.5"
        light = registry.parse("sensor_gain:sensor=left,factor=0.5")
        assert str(light) == "sensor_gain:sensor=left,factor=0.5"


LOOP = """
<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody><body>
  <joint name="knee" axis="0 1 0" armature="0.01" damping="0.05"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.6"/>
</body></worldbody><actuator>{}</actuator></mujoco>
"""
KP, KD = 25.0, 0.8


@pytest.mark.parametrize("period", [0.005, 0.01])
def test_a_loop_in_a_computer_is_one_with_its_period(period):
    goals = [
        0.4 * np.sin(3 * t) + 0.3 * (np.sin(7 * t) > 0)
        for t in np.arange(round(3 / period)) * period
    ]

    def moved(model, loop) -> np.ndarray:
        data, path, last = mujoco.MjData(model), [], 0.0
        for goal in goals:
            at = data.qpos[0]
            data.ctrl[0] = (
                KP * (goal - at) - KD * (at - last) / period if loop else goal
            )
            last = at
            for _ in range(round(period / model.opt.timestep)):
                mujoco.mj_step(model, data)
                path.append(data.qpos[0])
        return np.array(path)

    real = moved(built(xml=LOOP.format('<motor joint="knee"/>')), loop=True)
    servo = LOOP.format(f'<position name="a" joint="knee" kp="{KP}" kv="{KD}"/>')
    apart = [
        np.std(real - moved(built(*texts, xml=servo), loop=False))
        for texts in ((), (f"actuator_period:part=a,period={period}",))
    ]
    assert apart[1] < 0.3 * apart[0]


@pytest.mark.parametrize(
    ("dynamics", "begins"), [("", 0.0), ('dyntype="filter" dynprm="0.06"', 0.06)]
)
def test_a_valve_that_is_slow_follows_by_its_time_constant(dynamics, begins):
    xml = LOOP.format(f'<general name="a" joint="knee" gainprm="2" {dynamics}/>')
    model = built("actuator_lag:part=a,added=0.1", xml=xml)
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    constant = begins + 0.1
    mujoco.mj_step(model, data, round(constant / model.opt.timestep))
    assert data.act[0] == pytest.approx(1 - np.exp(-1), abs=0.01)


@pytest.mark.parametrize(
    ("number", "speed", "degree"), [("density", 3.0, 2), ("viscosity", 0.1, 1)]
)
def test_drag_goes_with_the_number_of_the_medium(number, speed, degree):
    xml = LOOP.format("").replace("<mujoco>", f'<mujoco><option {number}="900"/>')
    drags = []
    for texts, times in (([], 1), ([], 2), ([f"fluid_{number}:factor=1.5"], 1)):
        model = built(*texts, xml=xml.replace('damping="0.05"', ""), gravity=False)
        data = mujoco.MjData(model)
        data.qvel[0] = times * speed
        mujoco.mj_forward(model, data)
        drags.append(data.qfrc_passive[0])
    assert drags[0] < 0
    assert np.array(drags) / drags[0] == pytest.approx([1, 2**degree, 1.5])


def test_a_valve_that_integrates_has_no_time_constant():
    xml = LOOP.format('<general name="a" joint="knee" dyntype="integrator"/>')
    with pytest.raises(BnsError, match="'a' has dynamics without a time constant"):
        built("actuator_lag:part=a,added=0.1", xml=xml)


def test_a_loop_with_a_damping_ratio_has_the_period_of_one_with_that_damping():
    servo = LOOP.format('<position name="a" joint="knee" kp="25" {}/>')
    whole = built(xml=servo.format('dampratio="1"'))
    damping = f'kv="{-whole.actuator_biasprm[0, 2]}"'
    slow = "actuator_period:part=a,period=0.005"
    one, other = (built(slow, xml=servo.format(a)) for a in ('dampratio="1"', damping))
    np.testing.assert_allclose(one.actuator_biasprm, other.actuator_biasprm)
    np.testing.assert_allclose(one.dof_armature, other.dof_armature)
    assert one.actuator_biasprm[0, 2] > whole.actuator_biasprm[0, 2]


@pytest.mark.parametrize(
    ("limits", "ends"),
    [
        ("", (-1e9, 0.3)),
        ('range="-0.5 0.2"', (-0.5, 0.2)),
        ('range="-0.5 0.2" limited="false"', (-1e9, 0.3)),
    ],
)
def test_a_stop_is_met_beside_those_that_the_model_has(limits, ends):
    joint = 'name="knee" axis="0 1 0"'
    xml = LOOP.format('<motor joint="knee"/>').replace(joint, f"{joint} {limits}")
    xml = xml.replace("<mujoco>", '<mujoco><compiler angle="radian"/>')
    model = built("joint_stop:part=knee,high=0.3", xml=xml)
    assert model.jnt_limited[0]
    assert tuple(model.jnt_range[0]) == pytest.approx(ends)


@pytest.mark.parametrize(
    ("effect", "forces"),
    [("above=40,high=0.3", (0.0, 0.0, -4.0)), ("below=20,low=0.1", (4.0, 0.0, 0.0))],
)
def test_a_bumper_pushes_back_beyond_where_it_begins(effect, forces):
    model = built(f"joint_bumper:part=elbow,{effect}", gravity=False)
    data = mujoco.MjData(model)
    for angle, force in zip((-0.1, 0.2, 0.4), forces, strict=True):
        data.joint("elbow").qpos = angle
        mujoco.mj_forward(model, data)
        assert data.qfrc_spring[model.joint("elbow").dofadr[0]] == pytest.approx(
            force, abs=0.01
        )
