"""A robot that stands free: its log is not cut, places are compared by strides."""

import mujoco
import numpy as np
import pytest

from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import start
from bns.gap.models.mjcf.model import STRIDE
from tests.gap.own_robots import described

LEGS = {"lf": (0.2, 0.12), "rf": (0.2, -0.12), "lh": (-0.2, 0.12), "rh": (-0.2, -0.12)}
LEG = """<body name="{name}_arm" pos="{x} {y} 0.04">
  <joint name="{name}_hip" axis="0 1 0" damping="0.3" armature="0.01"/>
  <geom type="capsule" fromto="0 0 0.02 0 0 0.2" size="0.015" mass="0.1"/></body>"""
ROBOT = """<mujoco model="stander"><option timestep="0.002"/><worldbody>
  <geom name="floor" type="plane" size="5 5 .1"/>
  <body name="trunk" pos="0 0 0.04"><freejoint name="base"/>
    <geom type="box" size="0.25 0.1 0.04" mass="8"/>LEGS</body></worldbody>
  <actuator>SERVOS</actuator></mujoco>"""
SEEN = ("x", "y", "z")
TRIED = tuple(
    f"{name}[{leg}_hip]"
    for name in ("joint_armature", "joint_damping", "actuator_kp")
    for leg in ("lf", "rh")
)
HOLD, SAMPLE = 0.02, 0.01  # [s]


def model():
    legs = "".join(LEG.format(name=n, x=x, y=y) for n, (x, y) in LEGS.items())
    servos = "".join(f'<position joint="{n}_hip" kp="40" kv="1"/>' for n in LEGS)
    return ROBOT.replace("LEGS", legs).replace("SERVOS", servos)


def recorded(folder, *, armature=0.0, away=0.4, seconds=10.0):
    """A log of it waving, at a place of its own, whose commands come up to a sample
    before they are told."""
    robot = mujoco.MjModel.from_xml_string(model())
    robot.dof_armature[-1] += armature
    rng, data = np.random.default_rng(4), mujoco.MjData(robot)
    data.qpos[0] = away
    mujoco.mj_step(robot, data, 500)
    data.time = 0.0
    begins = np.arange(0, seconds, HOLD)
    begins[1:] -= rng.uniform(0, SAMPLE, len(begins) - 1)
    phases = np.array([0.0, 0.5, 1.0, 1.5])
    goals = 0.3 * np.sin(4 * np.arange(0, seconds, HOLD)[:, None] + phases)
    goals -= goals[0]
    rows, now, steps = [], goals[0], round(SAMPLE / 0.002)
    for number in range(round(seconds / SAMPLE)):
        seen = [*data.qpos[:3], *data.qpos[3:7], *data.qpos[7:]]
        noise = [*[5e-4] * 3, *[1e-3] * 4, *[1e-3] * 4]
        at = np.searchsorted(begins, data.time + 1e-9, side="right") - 1
        rows.append([number * SAMPLE, *goals[at], *rng.normal(seen, noise)])
        for _ in range(steps):
            now = goals[np.searchsorted(begins, data.time + 1e-9, side="right") - 1]
            data.ctrl[:] = now
            mujoco.mj_step(robot, data)
    head = ["time", *(f"{n}_hip_target" for n in LEGS)]
    head += [f"trunk_pos_{axis}" for axis in SEEN] + [f"trunk_q{w}" for w in "wxyz"]
    head += [f"{n}_hip" for n in LEGS]
    log = folder / "log.csv"
    np.savetxt(log, rows, delimiter=",", header=",".join(head), comments="")
    return log


@pytest.fixture(scope="module")
def stander(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stander")
    log = recorded(folder)
    return *described(folder, model(), log), log


def test_its_log_is_not_cut_and_columns_are_found(stander):
    found, own, log = stander
    assert own.config.cut == 0
    assert own.config.window == pytest.approx(HOLD)
    (trial,) = own.read_log(str(log))
    assert len(trial.commands) > 400
    told = " ".join(found.guessed)
    assert "trunk_yaw, trunk_pitch, trunk_roll: from trunk_qx" in told
    told += " ".join(found.unsure)  # it hardly moves
    assert all(f"trunk_pos_{a}: body 'trunk' along {a} in m, by" in told for a in SEEN)


def test_what_a_free_joint_carries_is_found(stander):
    free = start.free(stander[1].physics.model)
    assert {"trunk", "lf_arm"} <= free and "world" not in free


def test_where_it_stands_does_not_matter_and_old_slips_are_no_errors(stander):
    _, own, log = stander
    (trial,) = own.read_log(str(log))
    windows = own.joint_windows(trial)
    before = own.compare(trial, trial.observed, windows)
    place = [c.name for c in own.channels].index("trunk_pos_x")
    moved = trial.observed.copy()
    moved[:, place] += 3.0
    np.testing.assert_allclose(own.compare(trial, moved, windows), before, atol=1e-9)
    slipped = trial.observed.copy()
    slipped[trial.times > 5.0, place] += 0.01
    change = own.compare(trial, slipped, windows)[:, place] - before[:, place]
    after = trial.times[windows.last] > 5.0 + STRIDE + 2 * SAMPLE
    assert change.max() == pytest.approx(0.01)
    np.testing.assert_allclose(change[after], 0, atol=1e-9)


def test_nothing_planted_is_no_gap(stander):
    _, own, log = stander
    found = diagnose(own.read_log(str(log)), own, rows=TRIED, full=False)
    assert found.verdict.kind == "no gap"


def test_a_planted_inertia_is_named_with_its_value(tmp_path):
    log = recorded(tmp_path, armature=0.01)
    _, own = described(tmp_path, model(), log)
    found = diagnose(own.read_log(str(log)), own, rows=TRIED, full=False)
    assert found.verdict.named == (("joint_armature[rh_hip]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.01, abs=0.002)
