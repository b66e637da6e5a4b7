"""A robot on a stand: its base is held, and its legs are simulated apart."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from bns.errors import BnsError, UnknownNameError
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import trees
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.model import OwnModel
from tests.gap.own_robots import described

LEGS = {"lf": (0.2, 0.12), "rf": (0.2, -0.12), "lh": (-0.2, 0.12), "rh": (-0.2, -0.12)}
LEG = """<body name="{name}_leg" pos="{x} {y} 0">
  <joint name="{name}_hip" axis="0 1 0" damping="0.1" armature="0.01"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.18" size="0.02" mass="0.3"/></body>"""
FLOOR = '<geom name="floor" type="plane" size="5 5 .1"/>'
ROBOT = """<mujoco model="walker"><option timestep="0.002"/><worldbody>FLOOR
  <body name="trunk" pos="0 0 0.2">BASE
    <geom type="box" size="0.25 0.1 0.04" mass="8"/>LEGS</body></worldbody>
  <actuator>SERVOS</actuator>
  <keyframe><key name="home" qpos="0 0 0.2 1 0 0 0 0.1 0.1 0.1 0.1"/></keyframe>
  </mujoco>"""
TRIED = tuple(
    f"{name}[{leg}_hip]" for name in ("joint_damping", "actuator_kp") for leg in LEGS
)


def model(*, floor=True, free=True):
    legs = "".join(LEG.format(name=n, x=x, y=y) for n, (x, y) in LEGS.items())
    servos = "".join(
        f'<position name="{n}_hip" joint="{n}_hip" kp="20"/>' for n in LEGS
    )
    text = ROBOT.replace("LEGS", legs).replace("SERVOS", servos)
    text = text.replace("FLOOR", FLOOR * floor).replace("BASE", "<freejoint/>" * free)
    return text if free else text.replace("0 0 0.2 1 0 0 0 0.1", "0.1")


def recorded(folder, *, stand, damping=0.0, seconds=9.0):
    """A log of its hips, on a stand or on the floor."""
    robot = mujoco.MjModel.from_xml_string(model(floor=not stand, free=not stand))
    if stand:  # else the hips' geoms touch the trunk, as if that were the world
        robot.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    robot.dof_damping[-1] += damping
    rng, data = np.random.default_rng(4), mujoco.MjData(robot)
    phases, rows = np.array([0.0, 0.5, 1.0, 1.5]), []
    mujoco.mj_step(robot, data, 500)
    for number in range(round(seconds / 0.01)):
        now = number * 0.01
        goals = 0.3 * np.sin(4 * now + phases) * min(now, 1.0)
        seen = [data.joint(f"{n}_hip").qpos[0] for n in LEGS]
        rows.append([now, *goals, *rng.normal(seen, 1e-3)])
        data.ctrl[:] = goals
        mujoco.mj_step(robot, data, 5)
    head = ["time", *(f"{n}_hip_target" for n in LEGS), *(f"{n}_hip" for n in LEGS)]
    log = folder / "log.csv"
    np.savetxt(log, rows, delimiter=",", header=",".join(head), comments="")
    return log


@pytest.fixture(scope="module")
def hung(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hung")
    log = recorded(folder, stand=True, damping=0.3)
    return *described(folder, model(), log), log


@pytest.mark.parametrize(
    ("floor", "why"), [(True, "its joints"), (False, "nothing to")]
)
def test_a_stand_is_found_and_its_log_is_cut(tmp_path, hung, floor, why):
    found, own = described(tmp_path, model(floor=floor), hung[2])
    assert own.config.held == ("trunk",) and own.config.cut > 0
    assert any(
        line.startswith("held: a stand") and why in line for line in found.unsure
    )


def test_a_stand_is_found_of_a_robot_that_logs_how_its_base_is_turned(tmp_path, hung):
    rows = np.genfromtxt(hung[2], delimiter=",", names=True)
    turned = np.random.default_rng(0).normal([1, 0, 0, 0], 1e-3, (len(rows), 4))
    log, names = tmp_path / "log.csv", [*rows.dtype.names]
    table = np.column_stack([*(rows[name] for name in names), turned])
    head = ",".join([*names, *(f"trunk_q{letter}" for letter in "wxyz")])
    np.savetxt(log, table, delimiter=",", header=head, comments="")
    _, own = described(tmp_path, model(), log)
    assert own.config.held == ("trunk",) and own.config.cut > 0
    assert [item.way for item in own.config.seen if item.turning] == [
        "yaw",
        "pitch",
        "roll",
    ]
    trials = own.read_log(str(log))
    (paths,) = own.simulate(trials[:1], [()])
    assert np.abs(paths[0][:, -3:]).max() < 1e-9


def test_a_robot_on_the_floor_is_not_held(tmp_path):
    found, own = described(tmp_path, model(), recorded(tmp_path, stand=False))
    assert not own.config.held and "held" not in found.toml


def test_held_bodies_touch_no_ground_and_keep_their_joints_poses(hung):
    own = hung[1]
    assert own.physics.model.nq == 4
    assert own.physics.model.key_qpos.tolist() == [[0.1] * 4]
    assert not own.physics.loads(own.read_log(str(hung[2]))).touching


def test_the_corrected_file_is_of_a_free_robot(tmp_path, hung):
    hung[1].write_corrected(["joint_damping:part=rh_hip,added=0.3"], tmp_path / "c.xml")
    made = mujoco.MjModel.from_xml_path(str(tmp_path / "c.xml"))
    assert made.nq == 11 and made.dof_damping[-1] == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("named", "error"), [("trunc", UnknownNameError), ("lf_leg", BnsError)]
)
def test_only_bodies_on_free_joints_are_held(tmp_path, hung, named, error):
    (tmp_path / "robot.xml").write_text(model())
    text = hung[0].toml.replace('held = ["trunk"]', f'held = "{named}"')
    (tmp_path / "own.toml").write_text(text.replace(text.split('"')[3], "robot.xml"))
    with pytest.raises(error, match=named):
        OwnModel(OwnConfig.read(tmp_path / "own.toml"))


def test_legs_simulated_apart_move_as_together(hung):
    own = hung[1]
    trials = own.read_log(str(hung[2]))[:2]
    sets = [
        {"joint_damping[lf_hip]": 0.1, "reading_offset[lf_hip]": 0.01},
        {"command_lag[all]": 0.03, "actuator_kp[rh_hip]": 0.8, "joint_damping[all]": 1},
        {"joint_damping[rf_hip]": 0.2, "start_speed[lh_hip]": 0.1},
    ]
    sets = [[values] * len(trials) for values in sets]
    whole = own.paths(trials, sets)
    own.physics.apart(own.physics.loads(trials))
    apart = own.paths(trials, sets)
    for row, other in zip(whole, apart, strict=True):
        np.testing.assert_allclose(row, other, atol=1e-9)


def test_what_was_kept_of_the_whole_robot_is_not_that_of_a_leg(hung):
    """Trials that begin in a pose have no state of their own, which would tell."""
    config = hung[1].config
    other = replace(config, recorded=False, seen=config.seen[::-1])
    own = OwnModel(other, threads=1)
    trials = [t.replace(conditions={}) for t in hung[1].read_log(str(hung[2]))[:1]]
    (whole,) = own.paths(trials, [[{}]])
    own.physics.apart(own.physics.loads(trials))
    (again,) = own.paths(trials, [[{}]])
    np.testing.assert_allclose(again[0], whole[0], atol=1e-9)


def test_a_start_that_is_off_is_told_from_the_one_that_was_seen(hung):
    own = hung[1]
    plain = [trial.replace(conditions={}) for trial in own.read_log(str(hung[2]))[:1]]
    names, (base, *moved) = own.started(plain, [{}])
    assert len(names) == len(moved) == len(LEGS)
    for column, path in enumerate(moved):  # where each hip is seen first is not exact
        off = path[0][0] - base[0][0]
        assert off[column] == pytest.approx(own.config.seen[column].noise)
        assert np.delete(off, column) == pytest.approx(0)


def test_one_simulation_tells_of_all_legs(hung, monkeypatch):
    own = OwnModel(hung[1].config, threads=1)
    (trial, *_) = own.read_log(str(hung[2]))
    own.physics.apart(own.physics.loads([trial]))
    jobs, run = [], own.physics._pool.map
    monkeypatch.setattr(
        own.physics._pool, "map", lambda j: jobs.append(len(j)) or run(j)
    )
    own.paths([trial], [[{f"joint_damping[{n}_hip]": 0.1}] for n in LEGS])
    own.paths(
        [trial], [[dict.fromkeys([f"joint_damping[{n}_hip]" for n in LEGS], 0.1)]]
    )
    assert jobs == [2]  # all legs off, all nominal; then all of it is known


def test_legs_on_the_floor_or_tied_are_one(hung):
    own = OwnModel(hung[1].config, threads=1)
    own.physics.apart(
        own.physics.loads(own.read_log(str(hung[2])))._replace(touching={"g"})
    )
    assert len(own.physics._trees.columns) == 1
    tie = '<equality><joint joint1="lf_hip" joint2="rh_hip"/></equality></mujoco>'
    tied = mujoco.MjModel.from_xml_string(model(free=False).replace("</mujoco>", tie))
    assert len(trees.Trees.of(own.config, tied).columns) == 1


def test_a_damped_hip_is_named(hung):
    own = hung[1]
    found = diagnose(own.read_log(str(hung[2])), own, rows=TRIED, full=False)
    assert found.verdict.named == (("joint_damping[rh_hip]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.3, abs=0.05)


@pytest.mark.parametrize(("turning", "held"), [(0.0, True), (0.1, False)])
def test_a_base_that_turns_is_held_by_no_stand(tmp_path, turning, held):
    log = recorded(tmp_path, stand=True)
    head, *rows = log.read_text().splitlines()
    turned = np.random.default_rng(1).normal(0, 1e-3, len(rows))
    turned += turning * np.sin(np.arange(len(rows)) / 50)
    lines = [f"{row},{at:.6f}" for row, at in zip(rows, turned, strict=True)]
    log.write_text("\n".join([f"{head},trunk_pitch", *lines]))
    _, own = described(tmp_path, model(), log)
    assert bool(own.config.held) == held
