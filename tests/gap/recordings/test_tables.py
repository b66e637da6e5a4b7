"""Logs of other tools: each kind gives its table; what is wrong with one is said."""

import csv
import json

import numpy as np
import pytest

from bns.errors import FormatError
from bns.gap.importers import tables

TIMES = np.arange(6) * 0.02
GOALS = np.column_stack([np.sin(TIMES), np.cos(TIMES)])
SEEN = GOALS + 0.01
JOINTS = ("hip", "knee")


def columns(table, role):
    return {c.name: c for c in table.columns if c.role == role}


def pace(path):
    import torch

    content = {"time": TIMES, "dof_pos": SEEN, "des_dof_pos": GOALS}
    torch.save({name: torch.tensor(value) for name, value in content.items()}, path)
    return path


def sage(path, *, unit=1e6):
    path.mkdir()
    (path / "joint_list.txt").write_text("\n".join(JOINTS) + "\n")
    for name, rows in (("control.csv", GOALS), ("state_motor.csv", SEEN)):
        late = 0.0 if name == "state_motor.csv" else 0.005
        with (path / name).open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["type", "timestamp", "positions"])
            for time, row in zip(TIMES, rows, strict=True):
                stamp = 1e9 + (time + late) * unit
                writer.writerow(["X", stamp, json.dumps(row.tolist())])
    return path


def lerobot(path, names=JOINTS):
    import pyarrow
    from pyarrow import parquet

    (path / "meta").mkdir(parents=True)
    (path / "data" / "chunk-000").mkdir(parents=True)
    feature = {"names": {"motors": [f"{name}.pos" for name in names]}}
    info = {"fps": 50, "features": dict.fromkeys(("action", "observation.state"))}
    info["features"] = {name: feature for name in info["features"]}
    (path / "meta" / "info.json").write_text(json.dumps(info))
    for episode in (1, 0):
        frames = {
            "timestamp": TIMES,
            "episode_index": np.full(6, episode),
            "action": list(GOALS + episode),
            "observation.state": list(SEEN + episode),
        }
        file = path / "data" / "chunk-000" / f"episode_{1 - episode:06d}.parquet"
        parquet.write_table(pyarrow.table(frames), file)
    return path


def mcap(path):
    from mcap.writer import Writer

    with path.open("wb") as file:
        log = Writer(file)
        log.start()
        channels = []
        for topic, schema in (("/joint_states", "JointState"), ("/cmd", "JointState")):
            number = log.register_schema(f"sensor_msgs/msg/{schema}", "jsonschema", b"")
            channels.append(log.register_channel(topic, "json", number))
        for time, goal, seen in zip(TIMES, GOALS, SEEN, strict=True):
            # names in another order than before: joints go by name
            for channel, row, late in (
                (channels[0], seen, 0.0),
                (channels[1], goal, 5e-3),
            ):
                turned = slice(None, None, -1 if time > 0.05 else 1)
                said = {"name": JOINTS[turned], "position": row[turned].tolist()}
                stamp = 10**18 + round((time + late) * 1e9)
                log.add_message(channel, stamp, json.dumps(said).encode(), stamp)
        log.finish()
    return path


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


def test_a_csv_keeps_its_numbers_alone(tmp_path):
    (tmp_path / "a.csv").write_text("t,mode,q\n0,run,1.5\n1,run,\n")
    table = tables.read(tmp_path / "a.csv")
    assert table.names == ("t", "q")
    np.testing.assert_array_equal(table["q"], [1.5, np.nan])
    with pytest.raises(FormatError, match=r"has no column 'x'; it has t, q"):
        table["x"]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.xyz", b"", "no log that is known"),
        ("a.pt", b"nothing", "PACE"),
        ("a.mcap", b"nothing", "MCAP"),
        ("a.csv", b"", "no CSV table"),
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
