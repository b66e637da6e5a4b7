"""Foreign logs: units, commands, trials, what is refused; CSV, TOML, MCAP."""

import json

import numpy as np
import pytest

from bns.errors import BnsError, FormatError, MissingDependencyError, UnknownNameError
from bns.worlds.data import dataset
from bns.worlds.data.importing import from_csv, from_mcap

LOG = """\
stamp,px,py,heading,vl,vr,run,light
1000,0,0,170,,,1,0.1
1100,10,0,175,100,100,1,0.2
1200,20,5,-175,100,100,1,0.3
1300,,,,100,100,1,0.4
1400,40,10,-165,50,100,1,0.5
1500,45,12,-150,50,100,1,0.6
5000,0,0,0,0,0,2,0.7
5200,1,1,1,0,0,2,0.8
"""
MAP = """\
robot = "khepera3"

[columns]
time = {column = "stamp", unit = "ms"}
x = {column = "px", unit = "mm"}
y = {column = "py", unit = "mm"}
yaw = {column = "heading", unit = "deg"}
left_speed = {column = "vl", unit = "mm/s"}
right_speed = {column = "vr", unit = "mm/s"}
light = {column = "light", unit = "1"}
trial = "run"
"""
PLAIN = {"time": "stamp", "x": "px", "y": "py", "yaw": "heading"}
UNITS = {"time": "ms", "x": "mm", "y": "mm", "yaw": "deg"}


@pytest.fixture
def log(tmp_path):
    """A CSV file."""
    file = tmp_path / "log.csv"
    file.write_text(LOG)
    return file


@pytest.fixture
def column_map(tmp_path):
    """A TOML file of its columns."""
    file = tmp_path / "map.toml"
    file.write_text(MAP)
    return file


def test_a_log_becomes_trials_in_si(log, column_map):
    first, second = from_csv(log, column_map)
    assert first.times == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert first.channel("x") == pytest.approx(
        [0, 0.01, 0.02, np.nan, 0.04, 0.045], nan_ok=True
    )
    assert np.rad2deg(first.channel("yaw")) == pytest.approx(
        [170, 175, 185, np.nan, 195, 210], nan_ok=True
    )
    assert first.channel("light")[3] == 0.4
    assert second.times == pytest.approx([0, 0.2])
    assert first.robot == "khepera3"


def test_stretches_of_equal_speeds_become_commands(log, column_map):
    first, second = from_csv(log, column_map)
    assert first.commands.values == pytest.approx(
        np.array([[0, 0], [0.1, 0.1], [0.05, 0.1]])
    )
    assert first.commands.durations == pytest.approx([0.1, 0.3, 0.1])
    assert first.boundaries.tolist() == [0, 1, 4, 5]
    assert second.commands.values.tolist() == [[0, 0]]


def test_speed_units_of_the_khepera(log, tmp_path):
    log.write_text("t,x,y,a,l,r\n0,0,0,0,14401,0\n1,0,0,0,14401,0\n")
    columns = {"time": "t", "x": "x", "y": "y", "yaw": "a"}
    columns |= {"left_speed": "l", "right_speed": "r"}
    units = {"left_speed": "khepera-speed", "right_speed": "khepera-speed"}
    (trial,) = from_csv(log, columns, units=units)
    assert trial.commands.values == pytest.approx(np.array([[0.1, 0.0]]))


def test_imported_trials_can_be_written_as_a_dataset(log, column_map, tmp_path):
    trials = from_csv(log, column_map)
    data = dataset.read(dataset.write(tmp_path / "data", trials))
    assert data.trials[0].observed.tobytes() == trials[0].observed.tobytes()


BAD = {
    "no file": (None, PLAIN, UNITS, FormatError, "cannot be read"),
    "empty": ("", PLAIN, UNITS, FormatError, "cannot be read"),
    "no rows": (
        "stamp,px,py,heading\n",
        PLAIN,
        UNITS,
        FormatError,
        "needs numbers|no s",
    ),
    "no column": ("stamp,px,py\n1,2,3\n", PLAIN, UNITS, FormatError, "heading"),
    "text": (
        "stamp,px,py,heading\n1,a,2,3\n",
        PLAIN,
        UNITS,
        FormatError,
        "'px' is string, it needs numbers",
    ),
    "time backwards": (
        "stamp,px,py,heading\n2,0,0,0\n1,0,0,0\n",
        PLAIN,
        UNITS,
        FormatError,
        "goes backwards at sample 1",
    ),
    "no yaw": (
        LOG,
        {"time": "stamp", "x": "px", "y": "py"},
        {},
        BnsError,
        "lacks 'yaw'",
    ),
    "one speed": (LOG, PLAIN | {"left_speed": "vl"}, {}, BnsError, "both left_speed"),
    "unit": (LOG, PLAIN, {"x": "inch"}, UnknownNameError, "unit of x 'inch'"),
    "unit of nothing": (LOG, PLAIN, {"z": "m"}, UnknownNameError, "'z'"),
    "no unit": (
        LOG,
        PLAIN | {"light": "light"},
        {},
        BnsError,
        "'light' needs its unit",
    ),
    "sensor lost": (
        "stamp,px,py,heading,light\n1,0,0,0,\n2,0,0,0,1\n",
        PLAIN | {"light": "light"},
        UNITS | {"light": "1"},
        FormatError,
        "light of sample 0",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_logs_and_maps_are_refused(case, log):
    text, columns, units, error, says = BAD[case]
    if text is None:
        log.unlink()
    else:
        log.write_text(text)
    with pytest.raises(error, match=says):
        from_csv(log, columns, units=units)


BAD_MAPS = {
    "not TOML": ("[columns", FormatError, "cannot be read"),
    "no table": ("robot = 'a'", FormatError, "no table"),
    "other key": ("colums = {}", UnknownNameError, "columns"),
    "no column": ("[columns]\ntime = {unit = 's'}", FormatError, "write time ="),
}


@pytest.mark.parametrize("case", BAD_MAPS)
def test_bad_map_files_are_refused(case, log, column_map):
    text, error, says = BAD_MAPS[case]
    column_map.write_text(text)
    with pytest.raises(error, match=says):
        from_csv(log, column_map)


def test_mcap_without_its_package_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mcap.reader", None)
    monkeypatch.setitem(__import__("sys").modules, "mcap.exceptions", None)
    with pytest.raises(
        MissingDependencyError, match=r"pip install 'bns-testbed\[mcap\]'"
    ):
        from_mcap(
            tmp_path / "log.mcap", {n: f"/a:{n}" for n in ("time", "x", "y", "yaw")}
        )


@pytest.fixture
def mcap_log(tmp_path):
    """An MCAP log with poses at 10 Hz and speeds that change in between."""
    writer_module = pytest.importorskip("mcap.writer")
    file = tmp_path / "log.mcap"
    with file.open("wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        pose, speed = (
            writer.register_channel(topic, "json", schema)
            for topic in ("/pose", "/speed")
        )

        def add(channel, time, **message):
            stamp = 1_700_000_000_000_000_000 + round(time * 1e9)
            data = json.dumps(message).encode()
            writer.add_message(channel, stamp, data, stamp)

        for k in range(6):
            add(pose, k / 10, position={"x": k, "y": 2 * k}, yaw=0.1 * k)
        add(speed, 0.15, left=0.1, right=0.05)
        add(speed, 0.30, left=0.2, right=0.05)
        writer.finish()
    return file


MCAP_MAP = {
    "time": "log_time",
    "x": "/pose:position.x",
    "y": "/pose:position.y",
    "yaw": "/pose:yaw",
    "left_speed": "/speed:left",
    "right_speed": "/speed:right",
}


def test_an_mcap_log_becomes_a_trial(mcap_log):
    (trial,) = from_mcap(mcap_log, MCAP_MAP, units={"time": "ns", "x": "mm"})
    times = [0.0, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5]
    assert trial.times == pytest.approx(times, abs=1e-9)
    seen = np.isfinite(trial.channel("x"))
    assert seen.tolist() == [time != 0.15 for time in times]
    assert trial.channel("x")[seen] == pytest.approx(np.arange(6) / 1000)
    assert trial.channel("y")[seen] == pytest.approx(2 * np.arange(6))
    assert trial.commands.values.tolist() == [[0, 0], [0.1, 0.05], [0.2, 0.05]]
    assert trial.boundaries.tolist() == [0, 2, 4, 6]
    assert trial.commands.durations == pytest.approx([0.15, 0.15, 0.2])


SENT = """\
stamp,px,py,heading,vl,vr,sent
0,0,0,0,0.1,0.1,0
100,10,0,0,0.1,0.1,0
200,20,0,0,0.2,0.1,140
300,30,0,0,0.2,0.1,140
400,40,0,0,0.0,0.0,400
500,40,0,0,0.0,0.0,400
"""


def test_commands_begin_when_they_were_sent(tmp_path):
    file = tmp_path / "sent.csv"
    file.write_text(SENT)
    columns = PLAIN | {"left_speed": "vl", "right_speed": "vr"}
    units = UNITS | {"command_time": "ms"}
    (exact,) = from_csv(file, columns | {"command_time": "sent"}, units=units)
    assert exact.commands.durations == pytest.approx([0.14, 0.26, 0.1])
    assert exact.times[exact.boundaries] == pytest.approx([0, 0.14, 0.4, 0.5])
    assert np.flatnonzero(np.isnan(exact.channel("x"))).tolist() == [2]
    assert "command_moments" not in exact.conditions
    (by_sample,) = from_csv(file, columns, units=UNITS)
    assert by_sample.commands.durations == pytest.approx([0.2, 0.2, 0.1])
    assert by_sample.conditions["command_moments"] == "sampled"
    file.write_text(SENT.replace(",140\n", ",50\n"))
    with pytest.raises(FormatError, match=r"command_time is 0\.05 s"):
        from_csv(file, columns | {"command_time": "sent"}, units=units)


def test_bad_mcap_logs_are_refused(mcap_log, tmp_path):
    with pytest.raises(FormatError, match="no message on the topic '/spd'"):
        from_mcap(mcap_log, MCAP_MAP | {"left_speed": "/spd:left"})
    with pytest.raises(FormatError, match="at 'z' there are x, y"):
        from_mcap(mcap_log, MCAP_MAP | {"x": "/pose:position.z"})
    with pytest.raises(BnsError, match="write /topic:field"):
        from_mcap(mcap_log, MCAP_MAP | {"x": "x"})
    text = tmp_path / "text.mcap"
    text.write_text("hello")
    with pytest.raises(FormatError, match="cannot be read as MCAP"):
        from_mcap(text, MCAP_MAP)
