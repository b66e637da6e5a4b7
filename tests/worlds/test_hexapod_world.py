"""The world of walking robots, and the servo law, against answers known in advance."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import BnsError, OutOfBoundsError, UnknownNameError
from bns.models import servo_pendulum
from bns.models.phantomx import gait, kinematics
from bns.worlds import registry
from bns.worlds.effects import registry as effects
from bns.worlds.physics import compile, servo_law
from bns.worlds.physics.servo_rollout import Drive, simulate
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


DT, SECONDS = 0.002, 2.0
PLAIN = {
    "coulomb": 0.0,
    "viscous": 0.0,
    "stribeck": 0.0,
    "load_friction": 0.0,
    "delay": 0.0,
}
"""the nominal servo without what a joint of MuJoCo does not have"""


def law(**changes):
    return servo_law.law({**servo_pendulum.law(), **changes})


def drive(goals, start=0.0, **more) -> Drive:
    goals = np.atleast_2d(goals)
    starts = np.full(len(goals), float(start))
    return Drive(goals=goals, start=starts, speed=0 * starts, every=1, **more)


def swing(runs: int = 1) -> np.ndarray:
    times = np.arange(round(SECONDS / DT)) * DT
    rates = np.linspace(1.0, 3.0, runs)[:, None]
    return 0.9 * np.sin(2 * np.pi * rates * times**1.5 / 2)


def by_mujoco(goals: np.ndarray, start: float, **numbers) -> np.ndarray:
    """Angles of the MJCF, stepped by MuJoCo, the law's duty as its control."""
    values = {**servo_pendulum.law(), **numbers}
    spec = models.spec("servo_pendulum")
    joint = spec.joint("shaft")
    brake = values["torque_constant"] ** 2 / values["resistance"]
    joint.damping[0] = brake + values["viscous"]
    joint.frictionloss = values["coulomb"]
    joint.solref_friction = [2 * DT, 1]  # dry friction as stiff as the step allows
    joint.solimp_friction[:3] = [0.9999, 0.9999, 1e-4]
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[0] = start
    stiffness, most = values["gain"] * values["error_gain"], values["duty_limit"]
    seen = [start]
    for goal in goals:
        data.ctrl[0] = np.clip(stiffness * (goal - data.qpos[0]), -most, most)
        mujoco.mj_step(model, data)
        seen.append(data.qpos[0])
    return np.array(seen)


def test_the_mjcf_holds_the_numbers_of_the_law():
    numbers, model = servo_pendulum.law(), models.spec("servo_pendulum").compile()
    stall = numbers["torque_constant"] * numbers["voltage"] / numbers["resistance"]
    brake = numbers["torque_constant"] ** 2 / numbers["resistance"]
    assert model.actuator("shaft").gear[0] == pytest.approx(stall, rel=1e-5)
    damping = model.joint("shaft").damping[0]
    assert damping == pytest.approx(brake + numbers["viscous"], rel=1e-4)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    arm = numbers["arm_mass"] * numbers["lever"] ** 2 / 3
    tip = numbers["mass"] * (numbers["lever"] ** 2 + numbers["gyration"] ** 2)
    assert inertia[0, 0] == pytest.approx(arm + tip + numbers["armature"], rel=1e-4)


def test_without_friction_it_is_mujoco():
    goals = swing()[0]
    ours = simulate(law(**PLAIN), drive(goals, start=0.4))[0, 0]
    theirs = by_mujoco(goals, 0.4, **PLAIN)
    assert np.abs(theirs).max() > 0.5
    np.testing.assert_allclose(ours, theirs, atol=1e-6)


def test_dry_friction_is_that_of_mujoco():
    numbers = {**PLAIN, "coulomb": 0.3}
    goals = swing()[0]
    ours = simulate(law(**numbers), drive(goals, start=0.4))[0, 0]
    theirs = by_mujoco(goals, 0.4, **numbers)
    smooth = simulate(law(**PLAIN), drive(goals, start=0.4))[0, 0]
    assert np.abs(ours - smooth).max() > 0.01
    np.testing.assert_allclose(ours, theirs, atol=3e-4)


def test_a_fall_without_power_keeps_its_energy():
    free = law(**PLAIN, quantisation=0.0)
    off = np.zeros((1, 2000))
    angles = simulate(free, drive(off, start=1.0, torque_on=off))[0, 0]
    assert angles.min() == pytest.approx(-1.0, abs=2e-3)
    assert angles[1000:].max() == pytest.approx(1.0, abs=2e-3)


def test_dry_friction_holds_a_lever_that_it_can_hold():
    numbers = law(**{**PLAIN, "coulomb": 0.5})
    off = np.zeros((1, 500))
    held = simulate(numbers, drive(off, start=0.8, torque_on=off))[0, 0]
    assert (held == held[0]).all()  # 0.39 N m of weight against 0.5
    falls = simulate(law(**PLAIN), drive(off, start=0.8, torque_on=off))[0, 0]
    assert falls[-1] < 0.5


def test_a_servo_droops_by_its_weight_over_its_stiffness():
    angles = simulate(law(**PLAIN), drive(np.full((1, 1500), np.pi / 2)))[0, 0]
    numbers = servo_pendulum.law()
    stall = numbers["torque_constant"] * numbers["voltage"] / numbers["resistance"]
    stiffness = numbers["gain"] * numbers["error_gain"] * stall
    weight = 9.81 * 0.1 * (0.535 + 0.036 / 2) * np.sin(angles[-1])
    assert np.pi / 2 - angles[-1] == pytest.approx(weight / stiffness, rel=1e-3)


def test_delay_shifts_the_answer_between_steps_too():
    step = np.zeros((1, 1000))
    step[:, 200:] = 0.1
    at_once = simulate(law(**PLAIN), drive(step))[0, 0]
    late = simulate(law(**{**PLAIN, "delay": 0.05}), drive(step))[0, 0]
    np.testing.assert_allclose(late[25:], at_once[:-25], atol=1e-12)
    half = simulate(law(**{**PLAIN, "delay": 0.051}), drive(step))[0, 0]
    middle = (late[1:] + late[:-1]) / 2
    np.testing.assert_allclose(half[1:], middle, atol=1e-3)


def test_a_lag_reaches_63_percent_at_its_time_constant():
    stiff = {**PLAIN, "gain": 1000.0, "armature": 0.0, "mass": 0.01, "arm_mass": 0.0}
    step = np.full((1, 1000), 0.1)
    step[:, 0] = 0.0
    angles = simulate(law(**stiff, lag=0.2), drive(step))[0, 0]
    assert angles[101] == pytest.approx(0.1 * (1 - np.exp(-1)), rel=0.05)


def test_limits_and_dead_zone():
    step = np.full((1, 2000), 0.02)
    numbers = {**PLAIN, "mass": 0.0, "arm_mass": 0.0}
    rests = simulate(law(**numbers, dead_zone=0.03), drive(step))[0, 0]
    assert not rests.any()
    far = np.full((1, 4000), 100.0)
    weak = law(**numbers | {"duty_limit": 0.5})
    speed = np.diff(simulate(weak, drive(far))[0, 0])[-1] / DT
    top = 0.5 * 12 / servo_pendulum.law()["torque_constant"]
    assert speed == pytest.approx(top, rel=1e-3)
    limited = law(**numbers | {"current_limit": 0.1})
    angles = simulate(limited, drive(far[:, :100]))[0, 0]
    push = 0.1 * servo_pendulum.law()["torque_constant"]
    expected = push / servo_pendulum.law()["armature"] * 0.2**2 / 2
    assert angles[-1] == pytest.approx(expected, rel=0.03)


def test_backlash_lets_the_lever_lag_behind_reversals():
    slow = 0.5 * np.sin(2 * np.pi * 0.5 * np.arange(2000) * DT)[None]
    tight = simulate(law(), drive(slow))[0, 0]
    loose = simulate(law(backlash=0.05), drive(slow))[0, 0]
    none = simulate(law(backlash=np.array([[0.0, 0.05]])), drive(slow))[0]
    np.testing.assert_allclose(none[0], tight, atol=1e-3)
    np.testing.assert_array_equal(none[1], loose)
    assert 0.005 < np.abs(loose - tight).max() < 0.06


def test_encoder_reads_in_steps_with_an_offset():
    still = drive(np.zeros((1, 100)), start=0.1)
    read = simulate(law(offset=0.1, quantisation=0.02), still)[0, 0]
    np.testing.assert_allclose(read / 0.02, np.rint(read / 0.02), atol=1e-9)
    assert read[0] == pytest.approx(0.1)


def test_runs_and_candidates_are_independent():
    goals = swing(3)
    masses = np.array([[0.3, 0.5, 1.0]])
    both = simulate(law(mass=masses), drive(goals))
    for run in range(3):
        for column in range(3):
            alone = simulate(law(mass=masses[0, column]), drive(goals[run]))[0, 0]
            np.testing.assert_array_equal(both[run, column], alone)


@pytest.mark.parametrize("name", [n for n in effects.names() if n[:6] == "servo_"])
def test_every_servo_effect_is_felt(name):
    effect = effects.get(name)
    changed = effect({p.name: p.example for p in effect.parameters}).change(law())
    goals = swing()
    assert np.ptp(simulate(changed, drive(goals)) - simulate(law(), drive(goals))) > 0


def test_bad_laws_are_refused():
    values = servo_pendulum.law()
    with pytest.raises(UnknownNameError, match="Did you mean 'mass'"):
        servo_law.law({**values, "masss": 1.0})
    with pytest.raises(OutOfBoundsError, match=r"servo lever = -1\.0 m"):
        servo_law.law({**values, "lever": np.array([0.1, -1.0])})
    with pytest.raises(OutOfBoundsError, match="nan"):
        servo_law.law({**values, "gain": np.nan})
    del values["delay"]
    with pytest.raises(UnknownNameError, match="'delay'"):
        servo_law.law(values)
    with pytest.raises(BnsError, match="start and a speed"):
        Drive(goals=np.zeros((2, 5)), start=np.zeros(1), speed=np.zeros(2))
