"""A description from an MJCF and a log: channels, units, start; and what follows."""

import mujoco
import numpy as np
import pytest

from bns.__main__ import main
from bns.errors import BnsError, FormatError
from bns.gap.describe import describe
from bns.gap.importers import tables
from bns.gap.models.mjcf import cuts, matching, start
from bns.gap.models.mjcf.model import OwnModel
from bns.gap.models.mjcf.rehearsal import Part
from bns.gap.recordings import load_recordings
from tests.gap.own_robots import ARM, MOTORS, SERVOS, described


def goals(times):
    return np.column_stack([0.5 * np.sin(3 * times), 0.3 + 0.4 * np.sin(2 * times)])


def recorded(path, *, seconds=12.0, unit=1.0, names="hip_goal,calf_goal,hip,calf"):
    """A log of the arm with servos at 100 Hz: two goals, two joints, the toe."""
    model = mujoco.MjModel.from_xml_string(ARM.replace("ACTUATORS", SERVOS))
    data, rng = mujoco.MjData(model), np.random.default_rng(1)
    times = np.arange(0, seconds, 0.01)
    rows = []
    for time in times:
        data.ctrl[:] = goals(time)
        mujoco.mj_forward(model, data)
        seen = data.qpos + rng.normal(0, 1e-3, 2)
        rows.append([*data.ctrl / unit, *seen / unit, 1e3 * data.site_xpos[0, 0]])
        mujoco.mj_step(model, data, 2)
    head = f"stamp,{names},toe"
    table = np.column_stack([1e6 + 1e3 * times, np.round(rows, 6)])
    np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.6f")
    return path


@pytest.fixture
def arm(tmp_path):
    log, text = tmp_path / "log.csv", ARM.replace("ACTUATORS", MOTORS)
    recorded(log, unit=np.pi / 180)
    return *described(tmp_path, text, log, kp=20, kd=1.5), log


def test_channels_are_told_by_name_and_units_by_motion(arm):
    found, model, _ = arm
    config = model.config
    assert [t.actuator for t in config.told] == ["FL_hip_joint", "FL_calf_joint"]
    assert [(s.quantity, s.part) for s in config.seen] == [
        ("joint", "FL_hip_joint"),
        ("joint", "FL_calf_joint"),
        ("site", "toe"),
    ]
    assert config.seen[2].axis == 0
    units = {name: source.unit for name, source in config.log.items()}
    assert units["time"] == "ms"
    assert {units["hip"], units["calf"], units["hip_goal"]} == {"deg"}
    assert units["toe"] == "mm"
    assert config.seen[0].noise == pytest.approx(1e-3, rel=0.3)
    assert config.recorded and config.cut == 3.0
    assert any("'stamp' in ms, 100 samples" in line for line in found.guessed)


def test_pieces_start_in_motion_and_the_loop_follows(arm):
    _, model, path = arm
    trials = load_recordings.trials([str(path)], model)
    assert len(trials) == 4
    state = trials[1].conditions[start.STATE]
    assert abs(state["FL_hip_joint"][1]) > 0.5  # [rad/s], it swings
    ((*made,),) = model.simulate(trials, [()])
    for trial, predicted in zip(trials, made, strict=True):
        rest = (trial.observed - predicted)[:, :2]
        assert np.nanstd(rest) < 3e-3  # 1e-3 is noise


def test_a_model_that_is_far_off_leaves_starts_as_the_data_tell_them(arm):
    found, model, path = arm
    soft = path.with_name("soft.toml")
    soft.write_text(found.toml.replace("kp = 20", "kp = 8"))
    models = model, OwnModel.read(soft, threads=1)
    one, other = (load_recordings.trials([str(path)], m)[1:] for m in models)
    for right, wrong in zip(one, other, strict=True):
        for joint, (_, sd) in right.conditions[start.UNSURE].items():
            speeds = (
                trial.conditions[start.STATE][joint][1] for trial in (right, wrong)
            )
            assert abs(np.subtract(*speeds)) < 4 * sd


def test_a_command_that_is_late_is_late_in_every_piece(arm):
    _, model, path = arm
    trials = load_recordings.trials([str(path)], model)[1:2]
    late = model.parse("command_delay:part=all,delay=0.05")
    ((plain,), (after,)) = model.simulate(trials, [(), (late,)])
    first = slice(0, 20)  # without the commands before, it would not differ smoothly
    assert 1e-3 < np.abs(plain - after)[first, :2].max() < 0.1


def test_goals_told_to_motors_need_a_loop(arm, tmp_path):
    with pytest.raises(BnsError, match="--kp and --kd"):
        describe(tmp_path / "robot.xml", tmp_path / "log.csv")


def test_a_torque_that_holds_a_joint_against_gravity_is_no_goal(tmp_path):
    (tmp_path / "tilt.xml").write_text(
        "<mujoco><worldbody><body><joint name='tilt' axis='0 1 0'/>"
        "<geom size='.05' pos='.2 0 0'/></body></worldbody>"
        "<actuator><motor name='tilt' joint='tilt'/></actuator></mujoco>"
    )
    times = np.arange(0, 8, 0.02)
    angle = np.sin(times)
    for share, held in ((0.3, True), (1.0, False), (np.rad2deg(1.0), False)):
        rows = np.stack([times, share * angle, angle], axis=1).round(5)
        text = "\n".join(",".join(map(str, row)) for row in rows.tolist())
        (tmp_path / "log.csv").write_text("time,tilt_cmd,tilt_angle\n" + text)
        if held:
            found = describe(tmp_path / "tilt.xml", tmp_path / "log.csv")
            assert 'unit = "1"' in found.toml
        else:
            with pytest.raises(BnsError, match="is a goal of a joint"):
                describe(tmp_path / "tilt.xml", tmp_path / "log.csv")


def test_each_command_may_have_gains_of_its_own(arm, tmp_path):
    files = tmp_path / "robot.xml", tmp_path / "log.csv"
    found = describe(*files, kp=(20, 30), kd=1.5)
    gains = [line for line in found.toml.splitlines() if line[:2] in ("kp", "kd")]
    assert gains == ["kp = 20.0", "kd = 1.5", "kp = 30.0", "kd = 1.5"]
    with pytest.raises(BnsError, match="--kp has 3 values for 2 commands"):
        describe(*files, kp=(20, 30, 40))
    for wrong in ({"kp": -5}, {"kp": (20, 0)}, {"kp": 20, "kd": -1}):
        with pytest.raises(BnsError, match="is no gain: give a positive --kp"):
            describe(*files, **wrong)
    with pytest.raises(BnsError, match="give its --kp"):
        describe(*files, kd=1.5)


def test_names_that_say_nothing_go_by_order(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.replace("ACTUATORS", SERVOS))
    recorded(tmp_path / "log.csv", seconds=4, names="u0,u1,a,b")
    found = describe(tmp_path / "arm.xml", tmp_path / "log.csv")
    assert sum("by order" in line for line in found.unsure) == 4
    assert "cut" not in found.toml


def test_the_command_line_writes_what_python_gives(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text(ARM.replace("ACTUATORS", SERVOS))
    recorded(tmp_path / "log.csv", seconds=4)
    assert main(["gap", "describe", "arm.xml", "log.csv"]) == 0
    found = describe("arm.xml", "log.csv")
    assert (tmp_path / "arm.toml").read_text() == found.toml
    said = capsys.readouterr().out
    assert all(line in said for line in (*found.guessed, *found.unsure))
    assert main(["gap", "describe", "arm.xml", "log.csv"]) == 2
    assert "exists and is not overwritten" in capsys.readouterr().err


def test_a_log_without_times_or_commands_is_said(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.replace("ACTUATORS", SERVOS))
    (tmp_path / "a.csv").write_text("time,hip,calf\n0,0,0.1\n0.1,1,0.2\n0.2,0,0.5\n")
    with pytest.raises(BnsError, match="No column"):
        describe(tmp_path / "arm.xml", tmp_path / "a.csv")
    (tmp_path / "b.csv").write_text("hip,calf\n0,0.1\n-1,0.2\n0,0.0\n")
    with pytest.raises(FormatError, match="no column of times"):
        describe(tmp_path / "arm.xml", tmp_path / "b.csv")


def test_a_parabola_gives_value_and_slope_and_how_sure_they_are():
    at = np.linspace(-1, 1, 7)
    exact = cuts.parabola(at, 2 + 3 * at - at**2, 0.1)
    assert exact[:2] == pytest.approx((2, 3))
    rng = np.random.default_rng(0)
    drawn = rng.normal(2 + 3 * at - at**2, 0.1, (500, 7))
    found = np.array([cuts.parabola(at, row, 0.1)[:2] for row in drawn])
    assert found.std(axis=0) == pytest.approx(exact[2:], rel=0.1)
    assert cuts.parabola(at, at**3, 1e-6)[3] > 0.01  # not a parabola: less sure


def test_command_time_dates_a_command_between_samples(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.replace("ACTUATORS", SERVOS))
    times = np.arange(0, 2, 0.1)
    told = np.where(times < 0.55, 0.0, 0.4)
    sent = np.where(times < 0.55, 0.0, 0.53)
    table = np.column_stack([times, told, told, sent, 0 * times, 0 * times])
    head = "time,hip_goal,calf_goal,command_time,hip,calf"
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=head, comments="")
    described = describe(
        tmp_path / "arm.xml", tmp_path / "a.csv", out=tmp_path / "arm.toml"
    )
    described.write(tmp_path / "arm.toml")
    model = OwnModel.read(tmp_path / "arm.toml", threads=1)
    (trial,) = model.read_log(str(tmp_path / "a.csv"))
    assert trial.commands.durations[0] == pytest.approx(0.53)
    assert np.isnan(trial.observed[trial.boundaries[1]]).all()


def test_a_time_that_is_missing_is_told(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.replace("ACTUATORS", SERVOS))
    path = recorded(tmp_path / "log.csv", seconds=1.0)
    lines = path.read_text().splitlines()
    lines[6] = lines[6][lines[6].index(",") :]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(FormatError, match="'stamp' is missing in row 5"):
        describe(tmp_path / "arm.xml", path)


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ("cmd_torque q_hip", "cmd_torque"),
        ("tau_hip tau_calf q_hip q_calf", "tau_hip tau_calf"),
        ("torque_1 torque_2 motor1_rot motor2_rot", "torque_1 torque_2"),
        ("q_hip q_calf act_hip act_calf", "act_hip act_calf"),
        ("hip_vel_cmd calf_vel_cmd hip calf", "hip_vel_cmd calf_vel_cmd"),
        ("q_hip q_calf", ""),
        ("temp_hip temp_calf q_hip q_calf", ""),
        ("torque_ref_meas_hip torque_ref_meas_calf q_hip q_calf vel_cmd", "vel_cmd"),
    ],
)
def test_commands_are_found_where_no_goal_is(names, told):
    values = np.random.default_rng(0).normal(size=50)
    columns = [tables.Column(name, values) for name in names.split()]
    drives = ["hip", "calf"][: max(len(told.split()), 1)]
    found, _ = matching.roles(columns, drives, ["leg_hip", "leg_calf"])
    found = found or matching.second_choice(columns, drives)[0]
    assert [column.name for column in found] == told.split()


@pytest.mark.parametrize(
    ("name", "unit", "quantity"),
    [
        ("elbow_vel_rad_s", "rad/s", tables.SPEED),
        ("elbow velocity [deg/s]", "deg/s", tables.SPEED),
        ("elbow_deg_per_s", "deg/s", tables.SPEED),
        ("wheel_rpm", "rpm", tables.SPEED),
        ("d_elbow", "", tables.SPEED),
        ("elbow_dot", "", tables.SPEED),
        ("t_s", "s", tables.POSITION),
        ("elbow_deg", "deg", tables.POSITION),
    ],
)
def test_units_of_speed_are_read_and_are_no_part_of_the_name(name, unit, quantity):
    assert matching.unit(name) == unit
    assert matching.quantity(tables.Column(name, np.zeros(2))) == quantity
    assert matching.core(name) in ("elbow", "wheel", "t")


def test_a_word_that_one_part_alone_has_tells_which_it_is():
    columns = [
        tables.Column(f"{s} finger (mm)", np.zeros(2)) for s in ("left", "right")
    ]
    found, why = matching.match(columns, ["base", "right_slide", "left_slide"])
    assert found == {
        "left finger (mm)": "left_slide", "right finger (mm)": "right_slide"
    }  # fmt: skip
    assert set(why.values()) == {matching.BY_WORD}
    assert not matching.match(columns[:1], ["left_a", "left_b"])[0]


def test_a_place_may_end_with_its_unit():
    column = tables.Column("marker_x_mm", np.zeros(2))
    places = {"site": ["marker"], "body": ["base"]}
    found = matching.by_place([column], places)
    assert found == {column.name: (Part("site", "marker", "x"),)}


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("trunk_yaw_deg", Part("body", "trunk", "yaw")),
        ("heading", Part("body", "trunk", "yaw")),
        ("pos_y", Part("body", "trunk", "y")),
        ("theta", Part("body", "trunk", "yaw")),
        ("flexor_length", Part("tendon", "flexor")),
        ("cable", Part("tendon", "flexor")),
    ],
)
def test_a_turn_a_place_and_a_length_are_told_by_their_names(name, part):
    places = {"site": [], "body": ["world", "trunk"], "tendon": ["flexor"]}
    column = tables.Column(name, np.zeros(2))
    assert matching.by_place([column], places, "trunk") == {name: (part,)}


@pytest.mark.parametrize("name", ["elbow_x_cmd", "x_rad", "speed"])
def test_what_is_called_otherwise_is_of_no_place(name):
    places = {"site": [], "body": ["world", "trunk"], "tendon": []}
    assert not matching.by_place([tables.Column(name, np.zeros(2))], places, "trunk")


def test_an_actuator_that_nothing_tells_is_listed(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.replace("ACTUATORS", SERVOS))
    table = np.column_stack([np.arange(0, 2, 0.1), *np.zeros((3, 20))])
    head = "time,hip_goal,hip,calf"
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=head, comments="")
    found = describe(tmp_path / "arm.xml", tmp_path / "a.csv")
    assert any("told by no column" in line for line in found.unsure)


def test_what_never_changes_is_no_command():
    noise = np.random.default_rng(0).normal(size=60)
    columns = [
        tables.Column("ambient", np.full(60, 21.0)),
        tables.Column("a", np.repeat([0.0, 1.0, -1.0], 20)),
        tables.Column("b", noise),
    ]
    found, why = matching.second_choice(columns, ["hip"])
    assert [column.name for column in found] == ["a"]
    assert why == "they change in steps"


def test_a_column_called_as_an_actuator_is_measured_where_a_goal_is_called_so():
    values = np.zeros(5)
    columns = [tables.Column(name, values) for name in ("cmd_hip", "hip")]
    told, seen = matching.roles(columns, ["hip"], ["robot:hip"])
    assert [c.name for c in told] == ["cmd_hip"]
    assert [c.name for c in seen] == ["hip"]


def test_what_commands_cannot_move_has_no_effects(tmp_path):
    ball = '<body name="ball"><freejoint/><geom size=".05" mass="1"/></body>'
    text = ARM.replace("ACTUATORS", MOTORS).replace("<worldbody>", "<worldbody>" + ball)
    (tmp_path / "arm.xml").write_text(text)
    told = "".join(
        f'[commands.{name}]\nactuator = "FL_{name}_joint"\nunit = "1"\n'
        "low = -1\nhigh = 1\n"
        for name in ("hip", "calf")
    )
    seen = '[observed.hip]\njoint = "FL_hip_joint"\nunit = "rad"\nnoise = 0.001\n'
    (tmp_path / "own.toml").write_text(f'name = "arm"\nmodel = "arm.xml"\n{told}{seen}')
    names = [row.name for row in OwnModel.read(tmp_path / "own.toml").listed]
    assert "body_mass[lower]" in names and "command_limit[calf]" in names
    assert not any("ball" in name for name in names)


def test_a_place_that_one_trial_does_not_move_is_found_in_another(tmp_path):
    """The calf alone, farthest: the toe stays in its plane. Then the hip, less far."""
    model = mujoco.MjModel.from_xml_string(ARM.replace("ACTUATORS", SERVOS))
    rng, rows = np.random.default_rng(2), []
    for trial, size in enumerate(([0.0, 0.8], [0.3, 0.0])):
        data = mujoco.MjData(model)
        for time in np.arange(0, 4, 0.01):
            data.ctrl[:] = np.sin(3 * time) * np.array(size)
            mujoco.mj_forward(model, data)
            seen = np.append(data.qpos, data.site_xpos[0, :2])
            seen = seen + rng.normal(0, 1e-3, 4)
            rows.append([time, trial, *data.ctrl, *seen])
            mujoco.mj_step(model, data, 2)
    head = "time,trial,hip_goal,calf_goal,hip,calf,toe_x,toe_y"
    log = tmp_path / "log.csv"
    np.savetxt(log, rows, delimiter=",", header=head, comments="", fmt="%.6f")
    _, model = described(tmp_path, ARM.replace("ACTUATORS", SERVOS), log)
    seen = model.config.seen
    assert [(item.part, item.axis) for item in seen[2:]] == [("toe", 0), ("toe", 1)]


def test_a_joint_that_is_stuck_has_the_unit_of_the_others(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.replace("ACTUATORS", SERVOS))
    log = recorded(tmp_path / "log.csv", seconds=4, unit=np.pi / 180)
    table = np.genfromtxt(log, delimiter=",", names=True)
    table["calf"] = 0.3
    head = ",".join(table.dtype.names)
    np.savetxt(log, np.array(table.tolist()), delimiter=",", header=head, comments="")
    said = describe(tmp_path / "arm.xml", log).unsure
    assert any("calf: joint 'FL_calf_joint' in deg" in line for line in said)


def test_stamps_that_jitter_are_no_command_before_its_time(tmp_path):
    times = np.arange(0, 2, 0.1)
    told = np.where(times < 0.55, 0.0, 0.4)
    for late, good in ((0.04, True), (0.06, False)):
        sent = np.where(times < 0.55, 0.0, 0.6 + late)
        table = np.column_stack([times, told, told, sent, 0 * times, 0 * times])
        head = "time,hip_goal,calf_goal,command_time,hip,calf"
        log = tmp_path / "a.csv"
        np.savetxt(log, table, delimiter=",", header=head, comments="")
        (tmp_path / "arm.xml").write_text(ARM.replace("ACTUATORS", SERVOS))
        out = tmp_path / f"{good}.toml"
        describe(tmp_path / "arm.xml", log, out=out).write(out)
        model = OwnModel.read(out, threads=1)
        if good:
            (trial,) = model.read_log(str(log))
            assert trial.commands.durations[0] == pytest.approx(0.6 + late)
        else:
            with pytest.raises(FormatError, match="a command is sent before its row"):
                model.read_log(str(log))
