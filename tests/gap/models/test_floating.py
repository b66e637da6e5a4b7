"""A body on a free joint aloft: its trials begin in the states of the data."""

import mujoco
import numpy as np
import pytest

from bns.errors import UnknownNameError
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import floating, view
from bns.gap.models.mjcf.described import TURNS
from bns.gap.models.mjcf.model import OwnModel
from tests.gap.own_robots import described

ROBOT = """<mujoco model="drone"><option timestep="0.002" integrator="RK4"/>
<default><general dyntype="filter" dynprm="0.03" gainprm="1" ctrlrange="0 4"/></default>
<worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <body name="quad" pos="0 0 1"><freejoint/>
    <inertial pos="0 0 0" mass="0.6" diaginertia="2e-3 2e-3 4e-3"/>SITES</body>
</worldbody><actuator>ROTORS</actuator></mujoco>"""
ROTORS = {"m1": (1, -1, -1), "m2": (-1, 1, -1), "m3": (1, 1, 1), "m4": (-1, -1, 1)}
HOVER, SAMPLE = 0.6 * 9.81 / 4, 0.01
TRIED = ("actuator_gain[m2]", "actuator_lag[m2]", "command_delay[all]")


def model():
    sites = "".join(
        f'<site name="{n}" pos="{0.1 * x} {0.1 * y} 0"/>'
        for n, (x, y, _) in ROTORS.items()
    )
    rotors = "".join(
        f'<general name="{n}" site="{n}" gear="0 0 1 0 0 {0.016 * turn}"/>'
        for n, (*_, turn) in ROTORS.items()
    )
    return ROBOT.replace("SITES", sites).replace("ROTORS", rotors)


def angles(data):
    frame = data.xmat[1:2]
    return np.array([view.angle(frame, way)[0] for way in TURNS])


def recorded(folder, *, gain=1.0, flights=3, seconds=3.0):
    """Flights under a loop that holds it level, and leans where it is told."""
    robot = mujoco.MjModel.from_xml_string(model())
    robot.actuator("m2").gainprm[0] *= gain
    rng, rows = np.random.default_rng(2), []
    for flight in range(flights):
        data = mujoco.MjData(robot)
        data.act[:] = HOVER
        mujoco.mj_forward(robot, data)
        goal = np.zeros(3)
        for number in range(round(seconds / SAMPLE)):
            if number % 50 == 0:
                goal = np.append(rng.uniform(-0.15, 0.15, 2), 0.0)
            away = angles(data) - goal
            push = -0.6 * away - 0.12 * data.qvel[3:6]
            lift = HOVER - 0.8 * (data.qpos[2] - 1.0) - 0.5 * data.qvel[2]
            data.ctrl[:] = [
                lift + 2.5 * (y * push[0] - x * push[1]) + 4 * turn * push[2]
                for x, y, turn in ROTORS.values()
            ]
            seen = [*data.qpos[:3], *angles(data)]
            noise = [5e-4] * 3 + [2e-3] * 3
            now = number * SAMPLE
            rows.append([flight, now, *data.ctrl, *rng.normal(seen, noise)])
            mujoco.mj_step(robot, data, round(SAMPLE / 0.002))
    head = ["trial", "time", *(f"{n}_cmd" for n in ROTORS), *"xyz", *TURNS]
    log = folder / "log.csv"
    np.savetxt(log, rows, delimiter=",", header=",".join(head), comments="")
    return log


def test_a_body_is_placed_as_it_is_told_and_turns_as_fast():
    robot = mujoco.MjModel.from_xml_string(model())
    data, short = mujoco.MjData(robot), 1e-5
    places = dict(x=1.0, y=-2.0, z=0.5, roll=0.7, pitch=-0.4, yaw=2.9)
    speeds = dict(x=0.3, y=0.2, z=-0.1, roll=1.5, pitch=-0.8, yaw=0.6)
    floating.place(data, 1, places, speeds)
    mujoco.mj_forward(robot, data)
    np.testing.assert_allclose(data.qpos[:3], [1.0, -2.0, 0.5])
    before = angles(data)
    np.testing.assert_allclose(before, [places[way] for way in TURNS])
    mujoco.mj_integratePos(robot, data.qpos, data.qvel, short)
    mujoco.mj_forward(robot, data)
    rates = [speeds[way] for way in TURNS]
    np.testing.assert_allclose((angles(data) - before) / short, rates, rtol=1e-3)
    floating.place(data, 1, {"yaw": -1.0})
    mujoco.mj_forward(robot, data)
    np.testing.assert_allclose(angles(data), [*before[:2], -1.0], atol=1e-4)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drone")
    log = recorded(folder)
    return *described(folder, model(), log), log


def test_what_flies_begins_aloft_and_its_log_is_cut(flown):
    found, own, log = flown
    assert "aloft" in " ".join(found.unsure)
    assert own.config.recorded and not own.config.settle
    assert [item.state for item in own.config.seen if item.floats][:2] == [
        "quad.x",
        "quad.y",
    ]
    trials = own.read_log(str(log))
    assert len(trials) > 3
    (path,) = own.paths(trials, [[{}] * len(trials)])
    left = [
        np.nanmean(((trial.observed - made) / own.resolution) ** 2)
        for trial, made in zip(trials, path, strict=True)
    ]
    assert np.median(left) < 1.5


def test_a_joint_without_a_name_is_not_listed(flown):
    own = flown[1].config.model.parent / "own.toml"
    wrong = own.with_name("wrong.toml")
    wrong.write_text(f"{own.read_text()}\n[effects]\nencoder_offset = ['base']\n")
    with pytest.raises(UnknownNameError, match="There is none"):
        OwnModel.read(wrong, threads=1)


def test_nothing_planted_is_no_gap(flown):
    _, own, log = flown
    found = diagnose(own.read_log(str(log)), own, rows=TRIED, full=False)
    assert found.verdict.kind == "no gap"


def test_a_weak_rotor_is_named(tmp_path):
    log = recorded(tmp_path, gain=0.9, flights=2, seconds=2.0)
    _, own = described(tmp_path, model(), log)
    found = diagnose(own.read_log(str(log)), own, rows=TRIED, full=False)
    assert found.verdict.named == (("actuator_gain[m2]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.9, abs=0.01)
