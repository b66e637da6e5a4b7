"""MCAP logs of ROS 2: trajectories, several topics, and bags of several files."""

import json
from pathlib import Path

import numpy as np
import pytest

from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.models.mjcf.channels import Work

ZERO = 10**18
KINDS = {"j": "JointState", "t": "JointTrajectory", "a": "Float64MultiArray"}
TIMES = np.arange(0, 4, 0.005)


def log(path, topics):
    """A log in JSON; `topics`: by name, its kind (`KINDS`) and messages by time [s]."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        made = Writer(file)
        made.start()
        for name, (kind, messages) in topics.items():
            schema = f"{'trajectory' if kind == 't' else 'sensor'}_msgs/msg/"
            number = made.register_schema(schema + KINDS[kind], "jsonschema", b"")
            channel = made.register_channel(name, "json", number)
            for time, message in messages:
                stamp = ZERO + round(time * 1e9)
                made.add_message(channel, stamp, json.dumps(message).encode(), stamp)
        made.finish()
    return path


def states(times=TIMES, names=("hip", "knee"), start=0.0):
    return [(t, {"name": names, "position": [start] * len(names)}) for t in times]


def plan(*points, names=("hip", "knee"), **more):
    """A trajectory; each point: when [s] and positions."""
    return {
        "joint_names": names,
        "points": [
            {
                "positions": positions,
                "time_from_start": {"sec": int(t), "nanosec": round(t % 1 * 1e9)},
                **{key: values[at] for key, values in more.items()},
            }
            for at, (t, positions) in enumerate(points)
        ],
    }


def goal(table, joint="knee"):
    """Times and goals of a joint, from the first command on."""
    (column,) = [c for c in table.columns if c.role == "told" and c.part == joint]
    return table["time"], column.values


def arm(path, *messages, start=0.0):
    told = {"/joint_states": ("j", states(start=start)), "/arm": ("t", messages)}
    return tables.read(log(path / "a.mcap", told))


def test_points_ahead_are_gone_to_from_where_the_robot_is(tmp_path):
    first = plan((0.5, [0, 1.5]), (1.5, [0, 2.5]))
    found = arm(tmp_path, (0.1, first), start=0.5)
    expected = np.interp(found["time"], [0.1, 0.6, 1.6], [0.5, 1.5, 2.5])
    np.testing.assert_allclose(goal(found)[1], expected, atol=1e-9)
    assert any("/arm: told as points ahead" in note for note in found.notes)


def test_a_message_replaces_what_is_left_of_the_one_before(tmp_path):
    turned = plan((0.5, [2, 0]), names=["knee", "hip"])
    found = arm(tmp_path, (0.0, plan((1.0, [0, 1]), (2.0, [0, 5]))), (1.5, turned))
    expected = np.interp(found["time"], [0, 1, 1.5, 2], [0, 1, 3, 2])
    np.testing.assert_allclose(goal(found)[1], expected, atol=1e-9)


def test_a_point_without_a_time_is_a_step_as_it_was(tmp_path):
    found = arm(tmp_path, (0.0, plan((0, [0, 1]))), (1.0, plan((0, [0, 2]))))
    np.testing.assert_allclose(goal(found)[1], 1.0 + (found["time"] > 0.999))
    assert not any("points ahead" in note for note in found.notes)


@pytest.mark.parametrize("order", [2, 3])
def test_velocities_and_accelerations_of_points_are_kept_to(tmp_path, order):
    # t^3 and t^4 from rest are what a cubic and a quintic give
    def at(t, power):
        return [[t**power] * 2, [power * t ** (power - 1)] * 2, [12 * t**2] * 2]

    power = order + 1
    more = {"velocities": [at(t, power)[1] for t in (1, 2)]}
    if order == 3:
        more["accelerations"] = [at(t, power)[2] for t in (1, 2)]
    message = plan(*((t, at(t, power)[0]) for t in (1, 2)), **more)
    times, values = goal(arm(tmp_path, (0.0, message)))
    np.testing.assert_allclose(values, np.minimum(times, 2) ** power, atol=1e-9)


def test_slow_states_and_lost_ones_do_not_make_the_command_coarse(tmp_path):
    times = TIMES[(TIMES < 0.3) | (TIMES > 1.0)]
    topics = {
        "/joint_states": ("j", states(times)),
        "/arm": ("t", [(0.0, plan((2.0, [0, 1])))]),
    }
    found = tables.read(log(tmp_path / "a.mcap", topics))
    assert np.diff(found["time"]).max() < 0.0101


@pytest.mark.parametrize(
    "wrong", [plan((1.0, [0, 1]), (0.5, [0, 2])), plan((1.0, [])), plan((1.0, [1]))]
)
def test_a_trajectory_that_no_controller_takes_is_said(tmp_path, wrong):
    with pytest.raises(FormatError, match="a time_from_start that grows"):
        arm(tmp_path, (0.0, plan((1.0, [0, 1]))), (1.0, wrong))


def test_of_several_topics_those_with_the_same_joints_are_read(tmp_path):
    told = plan((0, [0, 1]))
    topics = {
        "/gripper/joint_states": ("j", states(names=["finger"])),
        "/joint_states": ("j", states(TIMES[::2])),
        "/arm": ("t", [(0.0, told)]),
        "/hand": ("t", [(0.0, plan((0, [1]), names=["finger"]))]),
        "/unused_goal": ("a", []),
    }
    found = tables.read(log(tmp_path / "a.mcap", topics))
    assert {c.part for c in found.columns if c.role} == {"hip", "knee"}
    (note,) = [note for note in found.notes if note.startswith("topics")]
    assert "left out: /gripper/joint_states, /hand" in note


def test_topics_that_fit_alike_are_to_be_chosen(tmp_path):
    told = [(0.0, plan((0, [0, 1])))]
    topics = {
        "/joint_states": ("j", states()),
        "/one": ("t", told),
        "/two": ("t", told),
    }
    said = (
        r"topics /two and /one .* `mcap filter \S+a.mcap -o one.mcap -y /joint_states"
    )
    with pytest.raises(FormatError, match=said):
        tables.read(log(tmp_path / "a.mcap", topics))


def test_a_log_without_commands_says_what_to_record(tmp_path):
    with pytest.raises(FormatError, match=r"no messages of commands.*Record a topic"):
        tables.read(log(tmp_path / "a.mcap", {"/joint_states": ("j", states())}))


def test_a_bag_is_read_in_the_order_of_its_files(tmp_path):
    parts = [(0, TIMES[:9], [(0.0, plan((0, [0, 1])))]), (10, TIMES[-9:], [])]
    parts.insert(1, (2, TIMES[9:-9], [(1.0, plan((0, [0, 2])))]))
    for number, times, told in parts:
        topics = {"/joint_states": ("j", states(times)), "/arm": ("t", told)}
        log(tmp_path / f"bag_{number}.mcap", topics)
    found = tables.read(tmp_path)
    np.testing.assert_allclose(found["time"], TIMES, atol=1e-6)
    np.testing.assert_allclose(goal(found)[1], 1.0 + (TIMES > 0.999))
    (tmp_path / "other.mcap").write_bytes((tmp_path / "bag_0.mcap").read_bytes())
    with pytest.raises(FormatError, match="several recordings: give one of"):
        tables.read(tmp_path)


def test_a_log_that_lacks_its_end_is_said(tmp_path):
    whole = log(tmp_path / "a.mcap", {"/joint_states": ("j", states())}).read_bytes()
    for data, said in ((whole[:-900], "`mcap recover .*a.mcap -o "), (b"", "is empty")):
        (tmp_path / "a.mcap").write_bytes(data)
        with pytest.raises(FormatError, match=said):
            tables.read(tmp_path / "a.mcap")


@pytest.mark.parametrize("sec", [0, 5])
def test_times_of_arrival_are_noted(tmp_path, sec):
    def stamped(messages):
        return [(t, {**m, "header": {"stamp": {"sec": sec}}}) for t, m in messages]

    topics = {
        "/joint_states": ("j", stamped(states())),
        "/cmd": ("j", stamped(states())),
    }
    found = tables.read(log(tmp_path / "a.mcap", topics))
    assert any("logged" in note for note in found.notes) == (sec == 0)


def test_channels_of_topics_are_called_by_their_joints():
    """A topic's whole name would not fit beside an axis."""
    names = {
        "/cmd:position.knee": "knee",
        "/state:position.knee": "position.knee",
        "/state:velocity.knee": "velocity.knee",
        "/state:position.hip": "hip",
        "/other:position.ankle": "/other:position.ankle",
        "/state:position.ankle": "/state:position.ankle",
    }
    columns = [tables.Column(name, np.zeros(3)) for name in names]
    table = tables.Table(tuple(columns), "log")
    work = Work(Path("robot.xml"), "log.mcap", table, {}, None)
    work.told = [(columns[0], "knee", "rad")]
    work.seen = [(column, None, "rad") for column in columns[1:]]
    assert [work.channel(column, "rad") for column in columns] == [*names.values()]
