"""The servo law against MuJoCo, and against answers that are known beforehand."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import BnsError, OutOfBoundsError, UnknownNameError
from bns.models import servo_pendulum
from bns.worlds.effects import registry
from bns.worlds.physics import servo_law
from bns.worlds.physics.servo_rollout import Drive, simulate

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


@pytest.mark.parametrize("name", [n for n in registry.names() if n[:6] == "servo_"])
def test_every_servo_effect_is_felt(name):
    effect = registry.get(name)
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
