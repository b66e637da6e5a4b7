"""Effects against answers that are known beforehand."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import BnsError, UnknownNameError
from bns.worlds.damage import Event
from bns.worlds.effects import parts, registry
from bns.worlds.effects.base import ControlSignal, PoseSignal
from tests.worlds.effects.subjects import DT, ROVER, edited

RADIUS = 0.0205  # [m] wheel of the rover
KV = 0.00112  # [N m s/rad] gain of its motors


def control(values, command=None) -> ControlSignal:
    """Both wheels told the same speeds, one value a step."""
    values = np.repeat(np.asarray(values, float)[:, None], 2, axis=1)
    command = np.zeros(len(values), int) if command is None else np.asarray(command)
    return ControlSignal(
        times=np.arange(len(values)) * DT,
        values=values,
        command=command,
        channels=("left_speed", "right_speed"),
        dt=DT,
    )


def straight_drive(speed=0.1, seconds=2.0, every=20) -> PoseSignal:
    """Driving along x at `speed` [m/s]."""
    fine_times = np.arange(round(seconds / DT) + 1) * DT
    fine = np.stack([speed * fine_times, 0 * fine_times, 0 * fine_times], axis=1)
    return PoseSignal(fine_times[::every], fine[::every].copy(), fine_times, fine)


def apply(text, signal, active=None, seed=0):
    active = np.ones(len(signal.times), bool) if active is None else active
    return registry.parse(text).apply(signal, active, np.random.default_rng(seed))


def compiled(*texts) -> mujoco.MjModel:
    return edited(mujoco.MjSpec.from_string(ROVER), *texts)


def driven(model, wheel_speed=4.0, seconds=4.0) -> mujoco.MjData:
    """After driving with both wheels at `wheel_speed` [rad/s] from rest."""
    data = mujoco.MjData(model)
    data.ctrl[:] = wheel_speed
    mujoco.mj_step(model, data, nstep=round(seconds / model.opt.timestep))
    return data


class TestCommands:
    def test_latency_shifts_by_exactly_the_delay(self):
        told = control(np.arange(1.0, 101.0))
        late = apply("command_latency:delay=0.2", told)
        assert (late[:40] == 0).all()
        assert (late[40:] == told.values[:60]).all()

    def test_latency_between_steps_keeps_the_area(self):
        told = control(np.r_[np.ones(50), np.zeros(50)])
        late = apply("command_latency:delay=0.012", told)
        assert late[:4, 0] == pytest.approx([0, 0, 0.6, 1])
        assert late.sum() == pytest.approx(told.values.sum())

    def test_latency_longer_than_the_trial_is_a_stop(self):
        assert not apply("command_latency:delay=2", control(np.ones(100))).any()

    def test_intermittent_hits_every_third_command_and_not_the_rest(self):
        command = np.r_[np.repeat(np.arange(7), 10), -np.ones(5, int)]
        told = control(np.where(command >= 0, 0.1, 0.0), command)
        got = apply("wheel_intermittent:every=3,speed=0.05,wheel=left", told)[:, 0]
        hit = (command == 2) | (command == 5)
        assert (got[hit] == 0.05).all()
        assert (got[~hit] == told.values[~hit, 0]).all()

    def test_intermittent_is_rarer_when_milder(self):
        effect = registry.make("wheel_intermittent", every=3, speed=0.05)
        assert effect.scaled(0.5)["every"] == 6
        assert effect.scaled(0.5)["speed"] == 0.05
        assert effect.scaled(1e-6)["every"] == 0

    def test_stuck_wheel_ignores_commands_and_stops_with_them(self):
        told = control([0.1, -0.1, 0.0, 0.0], [0, 1, 2, -1])
        forward = apply("wheel_stuck_max:blend=1,speed=0.12", told)[:, 0]
        assert forward == pytest.approx([0.12, 0.12, 0.12, 0.0])
        signed = apply("wheel_stuck_max:blend=1,speed=0.12,direction=commanded", told)
        assert signed[:, 0] == pytest.approx([0.12, -0.12, 0.0, 0.0])

    @pytest.mark.parametrize("name, units", [("min", 8000), ("max", 17500)])
    def test_stuck_speeds_are_the_labs(self, name, units):
        speed = registry.make(f"wheel_stuck_{name}")["speed"]
        assert speed == pytest.approx(units / 144_010, rel=1e-4)

    def test_dead_band_and_saturation(self):
        told = control([0.01, -0.01, 0.05, -0.05, 0.2, -0.2])
        band = apply("dead_band:speed=0.05", told)[:, 0]
        assert band.tolist() == [0, 0, 0.05, -0.05, 0.2, -0.2]
        cut = apply("speed_saturation:limit=0.05", told)[:, 0]
        assert cut.tolist() == [0.01, -0.01, 0.05, -0.05, 0.05, -0.05]

    def test_a_reverse_gain_is_of_speeds_backwards_alone(self):
        told = control([0.1, -0.1, 0.0])
        both = apply("reverse_gain:wheel=right,factor=0.8", told)
        assert both[:, 0].tolist() == [0.1, -0.1, 0.0]
        assert both[:, 1].tolist() == pytest.approx([0.1, -0.08, 0.0])

    def test_dead_zone_takes_its_speed_off(self):
        told = control([0.01, -0.01, 0.05, -0.05, 0.2, -0.2])
        left = apply("dead_zone:speed=0.03", told)[:, 0]
        assert left == pytest.approx([0, 0, 0.02, -0.02, 0.17, -0.17])


class TestActuators:
    def test_lag_has_done_63_per_cent_at_its_time_constant(self):
        reached = apply("motor_lag:time_constant=0.1", control(np.ones(200)))[:, 0]
        ends = np.exp(-np.arange(201) * DT / 0.1)  # what is left at each step's ends
        assert reached == pytest.approx(1 - -np.diff(ends) * 0.1 / DT)
        assert (reached[19] + reached[20]) / 2 == pytest.approx(1 - 1 / np.e, abs=1e-3)

    @pytest.mark.parametrize("late", [0.1 * DT, DT, 20 * DT])
    def test_lag_is_late_by_its_time_constant_at_any_step(self, late):
        name = f"motor_lag:time_constant={late}"
        reached = apply(name, control(np.ones(2000)))[:, 0]
        assert (1 - reached).sum() * DT == pytest.approx(late)

    def test_lag_that_sets_in_while_driving_starts_from_the_speed_driven(self):
        active = np.arange(100) >= 50
        steady = apply("motor_lag:time_constant=0.1", control(np.ones(100)), active)
        assert steady == pytest.approx(np.ones((100, 2)))

    def test_battery_loses_its_share_with_time_and_distance(self):
        told = control(np.full(401, 0.1))  # 2 s and 0.2 m up to the last step
        got = apply("battery_sag:per_second=0.05,per_metre=1", told)
        assert got[0, 0] == 0.1
        assert got[-1, 0] == pytest.approx(0.1 * np.exp(-(0.05 * 2 + 1 * 0.2)))

    def test_backlash_loses_its_play_at_each_reversal(self):
        told = control(np.repeat([0.1, -0.1, 0.1], 200))  # 0.1 m each
        made = apply("wheel_backlash:play=0.02", told)[:, 0]
        ways = made.reshape(3, 200).sum(axis=1) * DT
        assert ways == pytest.approx([0.09, -0.08, 0.08])
        assert set(np.round(made, 9)) == {0.0, 0.1, -0.1}

    def test_battery_fades_from_trial_to_trial(self):
        event = Event.parse("battery_fade:per_trial=0.1@5")
        assert event.at(4) == event.at(5) == ()
        assert event.first_trial == 6
        (active,) = event.at(8)
        assert str(active.effect) == "battery_fade:per_trial=0.1,trials=3"
        told = control(np.full(10, 0.2))
        made = apply(str(active.effect), told)
        assert made == pytest.approx(np.full((10, 2), 0.2 * np.exp(-0.3)))

    def test_battery_is_charged_with_each_period(self):
        event = Event.parse("battery_fade:per_trial=0.1@0%4/3")
        trials = [[e.effect["trials"] for e in event.at(t)] for t in range(7)]
        assert trials == [[], [1], [2], [], [], [1], [2]]


class TestTracking:
    def test_latency_shows_where_the_robot_was(self):
        signal = straight_drive(speed=0.1)
        times, poses = apply("tracker_latency:delay=0.25", signal)
        assert (times == signal.times).all()
        expected = 0.1 * np.maximum(signal.times - 0.25, 0)
        assert poses[:, 0] == pytest.approx(expected, abs=1e-12)

    def test_scale_and_rotation(self):
        signal = straight_drive()
        _, poses = apply("tracker_scale:factor=1.1", signal)
        assert poses[-1] == pytest.approx([0.22, 0, 0])
        _, poses = apply("tracker_rotation:angle=0.5", signal)
        assert poses[-1] == pytest.approx([0.2 * np.cos(0.5), 0.2 * np.sin(0.5), 0.5])

    def test_noise_has_the_deviations_asked_for(self):
        signal = straight_drive(seconds=50, every=1)
        _, poses = apply("tracker_noise:position_sd=0.002,heading_sd=0.01", signal)
        spread = (poses - signal.poses).std(axis=0)
        assert spread == pytest.approx([0.002, 0.002, 0.01], rel=0.05)

    @pytest.mark.parametrize("length", [1, 5])
    def test_dropouts_lose_the_share_asked_for_in_bursts(self, length):
        signal = straight_drive(seconds=100, every=1)
        _, poses = apply(f"tracker_dropouts:probability=0.2,length={length}", signal)
        lost = np.isnan(poses[:, 0])
        assert lost.mean() == pytest.approx(0.2, abs=0.02)
        assert (np.isnan(poses).all(axis=1) == lost).all()
        edges = np.flatnonzero(np.diff(lost.astype(int)))
        bursts = np.diff(edges)[lost[edges[:-1] + 1]]
        assert bursts.min() == length

    def test_clock_gains_its_rate_from_its_onset_and_keeps_it(self):
        signal = straight_drive(seconds=3.0)
        active = (signal.times > 1.0) & (signal.times <= 2.0)
        times, poses = apply("clock_drift:rate=0.05", signal, active)
        gained = 0.05 * np.clip(signal.times - 1.0, 0, 1)
        assert times - signal.times == pytest.approx(gained, abs=1e-12)
        assert (poses == signal.poses).all()

    def test_a_marker_off_the_centre_goes_round_it(self):
        turn = np.stack([np.zeros(7), np.zeros(7), np.linspace(0, np.pi, 7)], axis=1)
        times = np.arange(7.0)
        _, seen = apply(
            "marker_mount:dx=0.02,dy=0,yaw=0.1", PoseSignal(times, turn, times, turn)
        )
        assert np.hypot(*seen[:, :2].T) == pytest.approx(0.02)
        assert seen[0] == pytest.approx([0.02, 0, 0.1])
        assert seen[3] == pytest.approx([0, 0.02, np.pi / 2 + 0.1])
        assert seen[-1] == pytest.approx([-0.02, 0, np.pi + 0.1])

    def test_a_shifted_camera_shifts_every_pose(self):
        signal = straight_drive()
        _, seen = apply("tracker_shift:dx=0.05,dy=-0.03", signal)
        assert seen - signal.poses == pytest.approx(
            np.tile([0.05, -0.03, 0], (len(seen), 1))
        )


class TestBodies:
    def test_an_eccentric_wheel_drives_by_fits_and_starts(self):
        spec, offset, phase = models.spec("khepera3"), 0.0002, 0.7
        registry.make("wheel_eccentricity", offset=offset, phase=phase).edit(spec)
        spec.option.timestep = 0.001  # a light wheel creeps, the less the finer
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
        data.ctrl[:] = 3.0  # [rad/s]
        wheel, ratios, angles = data.joint("left_wheel"), [], []
        for step in range(6000):
            mujoco.mj_step(model, data)
            if step < 1000:
                continue
            pitching = data.qvel[4]  # [rad/s] the base's frame is on the floor
            axle = data.qvel[0] + RADIUS * pitching
            ratios.append(axle / (wheel.qvel[0] + pitching))
            angles.append(wheel.qpos[0] + phase)
        wave = np.stack([np.ones_like(angles), np.sin(angles), np.cos(angles)], axis=1)
        mean, rise, other = np.linalg.lstsq(wave, np.array(ratios), rcond=None)[0]
        assert mean == pytest.approx(RADIUS, rel=1e-3)
        assert rise == pytest.approx(offset, rel=0.05)
        assert abs(other) < 0.05 * offset

    def test_a_dragging_caster_costs_its_friction(self):
        turning = []  # [rad/s] in the mean: the caster chatters
        for texts in ([], ["caster_drag:friction=0.1"]):
            ends = [driven(compiled(*texts), seconds=end) for end in (2.0, 4.0)]
            turned = [data.joint("left_wheel_joint").qpos[0] for data in ends]
            turning.append(np.diff(turned)[0] / 2.0)
        load = 0.69 * 9.81 * 0.011 / 0.0449  # [N] on the caster
        slower = 0.1 * load * RADIUS / (2 * KV)  # [rad/s]
        assert turning[0] - turning[1] == pytest.approx(slower, rel=0.03)

    def test_a_dragging_caster_turns_a_robot_alike_at_every_heading(self):
        model = compiled("caster_drag:friction=0.1")
        turned = []
        for heading in (0.0, np.pi / 8, np.pi / 4):
            data = mujoco.MjData(model)
            data.qpos[3:7] = [np.cos(heading / 2), 0, 0, np.sin(heading / 2)]
            data.ctrl[:] = (2.0, 4.0)
            mujoco.mj_step(model, data, nstep=round(1.0 / model.opt.timestep))
            turned.append(2 * np.arctan2(data.qpos[6], data.qpos[3]) - heading)
        assert turned == pytest.approx([turned[0]] * 3, rel=0.01)

    def test_a_slippery_floor_may_hold_alike_in_all_directions(self):
        model = compiled("floor_friction:factor=0.05,cone=elliptic")
        assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
        plain = compiled("floor_friction:factor=0.05")
        assert plain.opt.cone == compiled().opt.cone
        assert plain.geom_friction.tolist() == model.geom_friction.tolist()

    def test_wheel_diameter_moves_the_axle_with_the_radius(self):
        model = compiled("wheel_diameter:wheel=left,factor=1.1")
        wheel, geom = model.body("left_wheel"), model.geom("left_wheel_geom")
        assert geom.size[0] == pytest.approx(1.1 * RADIUS)
        assert wheel.pos[2] - geom.size[0] == pytest.approx(0)  # touches the floor
        assert model.geom("right_wheel_geom").size[0] == RADIUS

    def test_larger_wheels_drive_faster_and_level(self):
        plain = driven(compiled())
        large = driven(compiled("wheel_diameter:factor=1.1"))
        assert plain.qvel[0] == pytest.approx(4.0 * RADIUS, rel=0.01)
        assert large.qvel[0] / plain.qvel[0] == pytest.approx(1.1, rel=0.002)
        up = large.body("rover").xmat.reshape(3, 3)[2, 2]
        assert np.degrees(np.arccos(up)) < 0.1

    def test_axle_length_moves_both_wheels_apart(self):
        model = compiled("axle_length:factor=1.1")
        left, right = model.body("left_wheel").pos, model.body("right_wheel").pos
        assert left - right == pytest.approx([0, 1.1 * 2 * 0.0437, 0])
        assert left + right == pytest.approx([0, 0, 2 * RADIUS])

    def test_payload_follows_the_parallel_axis_theorem(self):
        model = compiled("payload:mass=0.69,x=0.031,y=0.02,z=0.0687")
        base = model.body("rover")
        # Two equal masses: the centre is half way, each half of (20, 20, 40) mm off.
        assert base.mass[0] == pytest.approx(1.38)
        assert base.ipos == pytest.approx([0.021, 0.01, 0.0487])
        d = np.array([0.01, 0.01, 0.02])
        added = 2 * 0.69 * (d @ d * np.eye(3) - np.outer(d, d))
        expected = np.diag([9e-4, 9e-4, 1.4e-3]) + added
        axes = np.empty(9)
        mujoco.mju_quat2Mat(axes, base.iquat)
        axes = axes.reshape(3, 3)
        assert axes @ np.diag(base.inertia) @ axes.T == pytest.approx(expected)

    @pytest.mark.parametrize("own", [0, 0.005])
    def test_payload_on_a_body_whose_geoms_give_its_inertia(self, own):
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="base")
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], mass=2)
        body.add_body(name="left_wheel")
        registry.parse(f"payload:mass=1,z=0.3,inertia={own}").edit(spec)
        base = spec.compile().body("base")
        assert base.mass[0] == pytest.approx(3)
        assert base.ipos == pytest.approx([0, 0, 0.1])
        ball, parallel = 0.4 * 2 * 0.1**2, 2 * 0.1**2 + 1 * 0.2**2
        assert sorted(base.inertia) == pytest.approx(
            [ball + own] + 2 * [ball + parallel + own]
        )

    def test_centre_of_mass_moves_and_inertia_stays(self):
        plain, moved = compiled(), compiled("centre_of_mass:dx=0.005,dy=-0.01")
        shift = moved.body("rover").ipos - plain.body("rover").ipos
        assert shift == pytest.approx([0.005, -0.01, 0])
        for model in (plain, moved):
            assert sorted(model.body("rover").inertia) == pytest.approx(
                [9e-4, 9e-4, 1.4e-3]
            )

    def test_slope_tilts_gravity_and_keeps_its_size(self):
        gravity = compiled(f"floor_slope:angle=0.1,direction={np.pi / 2}").opt.gravity
        expected = 9.81 * np.array([0, -np.sin(0.1), -np.cos(0.1)])
        assert gravity == pytest.approx(expected, abs=1e-12)

    def test_friction_of_the_contact_itself_is_scaled(self):
        data = driven(compiled("floor_friction:factor=0.1"), seconds=0.1)
        felt = {
            data.model.geom(contact.geom[1]).name: contact.friction[0]
            for contact in (data.contact[i] for i in range(data.ncon))
        }
        assert felt["left_wheel_geom"] == pytest.approx(0.08)
        assert felt["right_wheel_geom"] == pytest.approx(0.08)
        assert felt["caster"] < 1e-4

    def test_drag_slows_a_wheel_by_its_torque_over_the_motor_gain(self):
        plain, slowed = driven(compiled()), driven(compiled("rolling_drag:torque=1e-3"))
        assert plain.qvel[6:] - slowed.qvel[6:] == pytest.approx(1e-3 / KV, rel=0.01)

    def test_a_wheel_that_sticks_breaks_away_and_then_rolls_freely(self):
        model = compiled("rolling_drag:torque=1e-3,breakaway=2e-3")
        told = 3e-3 / KV  # [rad/s] that the motor gives as much torque for
        assert np.abs(driven(model, 0.5 * told).qvel[6:]).max() < 0.01
        rolling = driven(model, 1.3 * told).qvel[6:]
        assert rolling == pytest.approx(1.3 * told - 1e-3 / KV, rel=0.01)

    def test_torque_limit_bounds_the_torque(self):
        data = driven(compiled("torque_limit:factor=0.01,wheel=left"), seconds=0.05)
        assert data.actuator_force[0] == pytest.approx(0.01 * 0.057)
        assert data.actuator_force[1] > 2 * 0.01 * 0.057

    def test_a_motor_without_torque_does_not_drive(self):
        both = compiled("torque_limit:factor=0", "torque_limit:factor=0.5,wheel=left")
        data = driven(both, seconds=0.5)
        assert np.abs(data.actuator_force).max() < 1e-9
        assert abs(data.qpos[0]) < 1e-4

    def test_a_robot_without_wheels_is_refused(self):
        spec = mujoco.MjSpec()
        spec.modelname = "stone"
        with pytest.raises(BnsError, match="'stone' has no body 'left_wheel'"):
            parts.wheel(spec, "left")

    def test_a_motor_without_a_force_range_is_refused(self):
        spec = mujoco.MjSpec.from_string(ROVER)
        parts.actuator(spec, "left").forcerange = [0, 0]
        with pytest.raises(BnsError, match="'left_wheel' has no force range"):
            registry.make("torque_limit", factor=0.5).edit(spec)


def test_turning_costs_forward_speed_and_never_turns_it_round():
    told = np.array([[0.2, 0.0], [0.2, 0.5], [0.2, -0.5], [-0.2, 1.0], [0.01, 1.0]])
    channels = ("forward_speed", "turning_rate")
    signal = ControlSignal(np.arange(5) * DT, told, np.zeros(5, int), channels, DT)
    made = apply("turning_loss:loss=0.1", signal)
    np.testing.assert_allclose(made[:, 0], [0.2, 0.15, 0.15, -0.1, 0.0])
    np.testing.assert_array_equal(made[:, 1], told[:, 1])


def test_turning_costs_nothing_of_wheels():
    with pytest.raises(UnknownNameError, match=r"'forward_speed'.*left_speed"):
        apply("turning_loss:loss=0.1", control([0.1]))
