"""The world of walking robots against answers known in advance."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import BnsError, UnknownNameError
from bns.models.phantomx import gait, kinematics
from bns.worlds import registry
from bns.worlds.physics import compile
from bns.worlds.trial import Channel, Commands, body_displacements

LEGS = tuple(Channel(*item) for item in models.robot("phantomx").channels)
TRIPOD = Commands(gait.tripod(), np.full(11, 1.5), LEGS)


def told(values, limit=1.5) -> Commands:
    values = np.atleast_2d(values)
    return Commands(values, np.full(len(values), limit), LEGS)


def displacement(trial) -> float:
    return float(np.hypot(*(trial.poses_world[-1] - trial.poses_world[0])[:2]))


@pytest.fixture(scope="module")
def world():
    return registry.make("hexapod", truth=True, sample_dt=0.004)


@pytest.fixture(scope="module")
def walked(world):
    """A walk of the tripod gait: the trial, and what the physics did."""
    plans = world.plan([TRIPOD])
    return world.run([TRIPOD])[0], world.motions(plans)[0], plans[0].servos


def test_tripod_walks_straight_and_upright(walked):
    trial, walk, _ = walked
    assert trial.outcome == trial.outcome._replace(**dict.fromkeys(FLAGS, False))
    x, y, yaw = trial.poses_world[-1]
    assert 0.76 < x < 0.93  # m in eleven commands, five and a half strides of 0.16
    assert abs(np.arctan2(y, x)) < np.radians(12) and abs(yaw) < np.radians(12)
    assert 0.09 < x / trial.times[-1] < 0.13  # m/s
    i, j = trial.truth["qpos"][:, 4:6].T
    assert np.degrees(np.arccos(1 - 2 * (i * i + j * j))).max() < 12
    assert trial.truth["qpos"][:, 2].min() > 0.07
    assert walk.diverged == -1


FLAGS = ("left_arena", "fell", "diverged", "collided", "overloaded", "unrested")


def test_standing_feet_hardly_slip(walked):
    trial, _, servos = walked
    states = trial.truth["qpos"]
    turn = np.empty((len(states), 9))
    for row, quaternion in zip(turn, states[:, 3:7], strict=True):
        mujoco.mju_quat2Mat(row, quaternion)
    feet = kinematics.feet(states[:, servos.angles - 1])
    feet = np.einsum("tij,tfj->tfi", turn.reshape(-1, 3, 3), feet) + states[:, None, :3]
    stands = (feet[1:, :, 2] < 0.003) & (feet[:-1, :, 2] < 0.003)
    slips = np.linalg.norm(np.diff(feet[..., :2], axis=0), axis=-1) * stands
    assert stands.mean() > 0.5
    assert slips.sum(axis=0).mean() < 0.4 * displacement(trial)


def test_energy_balances(walked):
    """What the motors give goes into friction, braking and contacts; none appears."""
    _, walk, servos = walked
    model = compile.compiled("phantomx").model
    dt, joint = model.opt.timestep, model.joint("left_front_femur")
    angles, speeds = walk.states[:, servos.angles], walk.states[:, servos.speeds]
    actuator = model.actuator("left_front_femur")
    torque = actuator.gainprm[0] * (walk.control - angles[:-1])
    torque = np.clip(torque, *actuator.forcerange)
    mean = (speeds[:-1] + speeds[1:]) / 2
    given = (torque * mean).sum() * dt
    braked = (joint.damping[0] * mean**2).sum() * dt
    rubbed = (joint.frictionloss[0] * np.abs(mean)).sum() * dt
    lifted = model.body_mass.sum() * 9.81 * np.ptp(walk.states[[0, -1], 3])
    lost = given - braked - rubbed - lifted  # in contacts
    assert 0 < lost < 0.1 * given
    assert 50 < given < 200  # J


def test_a_trial_is_as_told(walked, world):
    trial, _, _ = walked
    names = [channel.name for channel in trial.channels]
    assert names[:3] == ["x", "y", "yaw"] and len(names) == 21
    assert names[3] == "left_front_coxa_position"
    took = np.diff(trial.times[trial.boundaries])
    assert (took < 1.5).all() and (took > 0.3).all()
    reached = trial.observed[trial.boundaries[1:], 3:]
    missed = np.abs(reached - TRIPOD.values)  # servos yield under load
    assert np.median(missed) < 0.06 and missed.max() < 0.45
    units = reached / 0.0051183
    np.testing.assert_allclose(units, np.rint(units), atol=1e-6)
    assert np.abs(trial.truth["qvel"][trial.boundaries]).max() < 0.3  # at rest


def test_random_commands_come_to_rest(world):
    rng = np.random.default_rng(3)
    lists = [told(rng.uniform(-0.5, 0.5, (11, 18)), 2.0) for _ in range(4)]
    for trial in world.run(lists):
        assert not trial.outcome.unrested and not trial.outcome.fell
        assert trial.times[-1] < 11 * 2.0 / 2
        moved = body_displacements(trial.command_poses_world)
        assert np.isfinite(moved).all()


def test_a_short_limit_ends_a_command_before_rest(world):
    far = np.full((2, 18), 0.5)
    trial = world.run([told(far, 0.1)])[0]
    assert trial.outcome.unrested
    np.testing.assert_allclose(trial.times[trial.boundaries], [0, 0.1, 0.2], atol=1e-9)


def test_servos_move_at_their_speed():
    goals = np.zeros((1, 18))
    goals[0, 1] = 1.2  # a femur up, in the air
    for speed in (1.0, 3.0):
        world = registry.make("hexapod", speed=speed, sample_dt=0.004, truth=True)
        trial = world.run([told(goals, 3.0)])[0]
        angle = trial.channel("left_front_femur_position")
        begin = np.argmax(angle > 0.4)
        end = np.argmax(angle > 0.9)
        took = trial.times[end] - trial.times[begin]
        assert took == pytest.approx(0.5 / speed, rel=0.1)


def test_falls_collisions_and_overloads_are_flagged(world):
    up = np.zeros((1, 18))
    up[0, [1, 7, 13]] = 1.3  # all left legs up: it tips over
    assert world.run([told(up)])[0].outcome.fell
    together = np.zeros((1, 18))
    together[0, [0, 12]] = -1.3, 1.3  # left front back, left middle forward
    seen = world.run([told(together)])[0].outcome
    assert seen.collided and not seen.fell
    assert not world.run([told(np.zeros((1, 18)))])[0].outcome.collided
    pushed = world.run([told(np.repeat(together, 8, axis=0))])[0].outcome
    assert pushed.overloaded and not pushed.overheated


def test_all_legs_away_or_a_fallen_start_are_refused():
    half = "leg_raised:legs=1,2,3,blend=1@30"
    with pytest.raises(BnsError, match="take all 6 legs away in trial 50"):
        registry.make("hexapod", damage=[half, "leg_missing:legs=4,5,6,loss=1@50"])
    registry.make("hexapod", damage=[f"{half}", "leg_limp:legs=4,5,6,loss=1@10..30"])
    with pytest.raises(BnsError, match="robot starts fallen"):
        registry.make("hexapod", reality=["leg_missing:legs=1,3,5,loss=1"])
    with pytest.raises(UnknownNameError, match="leg '7'"):
        registry.make("hexapod", damage=["leg_raised:legs=7,blend=1"])
    with pytest.raises(BnsError, match="are all of them"):
        registry.make("hexapod", damage=["leg_raised:legs=1,2,3,4,5,6,blend=1"])
    with pytest.raises(UnknownNameError, match="Did you mean 'left_front_femur'"):
        registry.make("hexapod", damage=["joint_locked:joint=left_frnt_femur,loss=1"])


def test_other_robots_and_effects_are_refused():
    with pytest.raises(BnsError, match=r"khepera3' is wheeled, .* take 'phantomx'"):
        registry.make("hexapod", robot="khepera3")
    with pytest.raises(BnsError, match="is for wheeled robots"):
        registry.make("hexapod", damage=["wheel_gain:factor=0.5"])
    with pytest.raises(BnsError, match="is for servo robots"):
        registry.make("hexapod", damage=["servo_dead_zone:angle=0.1"])
    world = registry.make("hexapod", damage=["loose_horn:angle=0.2@0:0.5s"])
    with pytest.raises(BnsError, match="adds joints"):
        world.run([TRIPOD])


def test_trials_go_through_a_dataset(walked, tmp_path):
    from bns.worlds.data import dataset

    trial = walked[0].replace(truth={})
    (back,) = dataset.read(dataset.write(tmp_path / "walk", [trial])).trials
    np.testing.assert_allclose(back.observed, trial.observed)
    np.testing.assert_allclose(back.commands.values, trial.commands.values)
    assert (back.channels, back.outcome) == (trial.channels, trial.outcome)
