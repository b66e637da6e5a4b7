"""Logs of other tools: each kind gives its table; what is wrong with one is said."""

import numpy as np
import pytest

from bench.storage.sample_files import (
    GOALS,
    JOINTS,
    SEEN,
    TIMES,
    lerobot,
    mcap,
    pace,
    sage,
)
from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.recordings import load_recordings


def columns(table, role):
    return {c.name: c for c in table.columns if c.role == role}


def test_a_pace_file_has_numbered_joints(tmp_path):
    table = tables.read(pace(tmp_path / "a.pt"))
    assert table.kind == "PACE file"
    assert list(columns(table, "told")) == ["des_dof_pos[0]", "des_dof_pos[1]"]
    np.testing.assert_allclose(table["dof_pos[1]"], SEEN[:, 1])
    np.testing.assert_allclose(table["time"], TIMES)


def test_a_pace_file_holds_no_code(tmp_path):
    import pathlib

    import torch

    torch.save({"time": pathlib.PurePosixPath("x")}, tmp_path / "a.pt")
    with pytest.raises(FormatError, match="cannot be read as a PACE file"):
        tables.read(tmp_path / "a.pt")


@pytest.mark.parametrize("make", [sage, mcap])
def test_commands_with_stamps_of_their_own_keep_them(make, tmp_path):
    table = tables.read(make(tmp_path / ("a.mcap" if make is mcap else "a")))
    told, seen = columns(table, "told"), columns(table, "seen")
    assert [c.part for c in told.values()] == list(JOINTS)
    goal, angle = list(told.values())[1], list(seen.values())[1]
    times = table["time"] - table["time"][0]
    # from the first command on: command, sample, command, ... 5 and 15 ms apart
    np.testing.assert_allclose(times[:4], [0, 0.015, 0.02, 0.035], atol=1e-6)
    np.testing.assert_allclose(goal.values[:4], np.repeat(GOALS[:2, 1], 2))
    assert np.isnan(angle.values[[0, 2]]).all()
    np.testing.assert_allclose(angle.values[[1, 3]], SEEN[1:3, 1])


def test_ros_2_messages_are_decoded(tmp_path):
    from mcap_ros2.writer import Writer

    header = "std_msgs/Header header\nstring[] name\nfloat64[] position\n"
    text = header + "=" * 80 + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\n"
    text += "string frame_id\n" + "=" * 80 + "\nMSG: builtin_interfaces/Time\n"
    text += "int32 sec\nuint32 nanosec\n"
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        log = Writer(file)
        kind = log.register_msgdef("sensor_msgs/msg/JointState", text)
        for number, time in enumerate(TIMES):
            for topic, row in (("/joint_states", SEEN), ("/command", GOALS)):
                stamp = {"sec": 5, "nanosec": round(time * 1e9)}
                message = {
                    "header": {"stamp": stamp, "frame_id": ""},
                    "name": list(JOINTS),
                    "position": row[number].tolist(),
                }
                log.write_message(topic, kind, message, 10**18 + number)
        log.finish()
    table = tables.read(path)
    np.testing.assert_allclose(table["time"], TIMES, atol=1e-9)  # the headers' stamps
    np.testing.assert_allclose(table["/joint_states:position.knee"], SEEN[:, 1])


def test_a_lerobot_dataset_has_a_trial_an_episode(tmp_path):
    table = tables.read(lerobot(tmp_path / "a"))
    np.testing.assert_array_equal(table["trial"], np.repeat([0, 1], 6))
    assert [c.part for c in columns(table, "seen").values()] == list(JOINTS)
    np.testing.assert_allclose(table["action.knee.pos"][:6], GOALS[:, 1])


def test_a_log_of_joints_is_not_of_a_robot_that_drives(tmp_path, model):
    place = lerobot(tmp_path / "a")
    with pytest.raises(FormatError, match="bns gap describe MJCF"):
        load_recordings.trials([str(place)], model)


def test_a_csv_keeps_its_numbers_alone(tmp_path):
    (tmp_path / "a.csv").write_text("t,mode,q\n0,run,1.5\n1,run,\n")
    table = tables.read(tmp_path / "a.csv")
    assert table.names == ("t", "q")
    np.testing.assert_array_equal(table["q"], [1.5, np.nan])
    with pytest.raises(FormatError, match=r"has no column 'x'; it has t, q"):
        table["x"]


@pytest.mark.parametrize(
    "rows",
    ["t;q\n0;1,5\n1;-0,25\n", "t;q\n0;1.5\n1;-0.25\n", "t\tq\n0\t1,5\n1\t-0,25\n"],
)
def test_semicolons_tabs_and_decimal_commas_are_read(rows, tmp_path):
    (tmp_path / "a.csv").write_text(rows)
    table = tables.read(tmp_path / "a.csv")
    assert table.names == ("t", "q")
    np.testing.assert_array_equal(table["q"], [1.5, -0.25])


def test_a_comma_in_a_text_is_no_decimal_one(tmp_path):
    (tmp_path / "a.tsv").write_text("t\tnote\tq\n0\tslow, 2,5 V\t1.5\n1\t\t-0.25\n")
    np.testing.assert_array_equal(tables.read(tmp_path / "a.tsv")["q"], [1.5, -0.25])


def test_text_among_numbers_is_named_with_its_line(tmp_path):
    rows = ["0,1.5", "1,", "2,1.7", "3,off", "4,1.9"]
    (tmp_path / "a.csv").write_text("\n".join(["t,q", *rows]) + "\n")
    said = r"a\.csv: the column 'q' holds 'off' in line 5, which is no number"
    with pytest.raises(FormatError, match=said):
        tables.read(tmp_path / "a.csv")


@pytest.mark.parametrize("notes", [["", "", "pushed", ""], ["1", "on", "off", "on"]])
def test_a_column_of_few_numbers_is_text(tmp_path, notes):
    rows = [f"{time},{note},{time}" for time, note in enumerate(notes)]
    (tmp_path / "a.csv").write_text("\n".join(["t,note,q", *rows]) + "\n")
    assert tables.read(tmp_path / "a.csv").names == ("t", "q")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.xyz", b"", "no log that is known"),
        ("a.pt", b"nothing", "PACE"),
        ("a.mcap", b"nothing", "MCAP"),
        ("a.csv", b"", "as CSV"),
    ],
)
def test_what_is_no_log_is_said(name, content, said, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FormatError, match=said):
        tables.read(tmp_path / name)


def test_files_that_do_not_fit_each_other_are_said(tmp_path):
    place = sage(tmp_path / "a")
    (place / "joint_list.txt").write_text("hip\n")
    with pytest.raises(FormatError, match="2 positions a row"):
        tables.read(place)


def test_a_column_is_there_once_and_of_numbers_that_can_be(tmp_path):
    for content, said in (("t,q,q\n0,1,2\n", "twice"), ("t,q\n0,inf\n", "inf")):
        (tmp_path / "a.csv").write_text(content)
        with pytest.raises(FormatError, match=said):
            tables.read(tmp_path / "a.csv")
    place = sage(tmp_path / "a")
    _say(place / "state_motor.csv", "1e12")
    with pytest.raises(FormatError, match=r"positions.hip' holds 1e\+12"):
        tables.read(place)


def test_a_value_that_is_missing_is_nan(tmp_path):
    place = sage(tmp_path / "a")
    whole = tables.read(place)["positions.hip"]
    _say(place / "state_motor.csv", "NaN")
    angle = tables.read(place)["positions.hip"]
    assert np.isnan(angle).sum() == np.isnan(whole).sum() + 1


def _say(path, value):
    """Another position of the first joint in the last row."""
    rows = path.read_text().rsplit("[", 1)
    path.write_text(f"{rows[0]}[{value},{rows[1].partition(',')[2]}")


def test_a_tensor_of_many_numbers_in_few_bytes_is_refused(tmp_path):
    import torch

    wide = torch.zeros(1, dtype=torch.float64).expand(10**12)
    torch.save({"time": wide, "dof_pos": wide, "des_dof_pos": wide}, tmp_path / "a.pt")
    with pytest.raises(FormatError, match="the most that is read"):
        tables.read(tmp_path / "a.pt")


def test_a_dataset_of_one_joint_has_numbers_where_others_have_lists(tmp_path):
    import pyarrow
    from pyarrow import parquet

    place = lerobot(tmp_path / "a", names=["hip"])
    for file in (place / "data").rglob("*.parquet"):
        frames = {"timestamp": TIMES, "episode_index": np.zeros(6)}
        frames |= {"action": GOALS[:, 0], "observation.state": SEEN[:, 0]}
        parquet.write_table(pyarrow.table(frames), file)
    table = tables.read(place)
    np.testing.assert_allclose(table["action.hip.pos"], np.repeat(GOALS[:, 0], 2))
