"""Datasets: exact round trip, the same bytes, every way to be refused; exported."""

import json
import shutil

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from bns.__main__ import WRONG_INPUT, main
from bns.errors import BnsError, FormatError
from bns.worlds import registry
from bns.worlds.data import dataset
from bns.worlds.trial import POSE_CHANNELS, Channel, Commands, Outcome, Trial


def trial(seed, lost=(), **changes):
    """A trial of random numbers with a light sensor."""
    rng = np.random.default_rng(seed)
    observed = rng.normal(size=(6, 4))
    observed[list(lost), :3] = np.nan
    values = {
        "commands": Commands(rng.uniform(-0.1, 0.1, (2, 2)), rng.uniform(0.1, 1, 2)),
        "times": np.cumsum(rng.uniform(0, 0.2, 6)),
        "observed": observed,
        "boundaries": [0, 3, 5],
        "channels": (*POSE_CHANNELS, Channel("light", "1")),
        "outcome": Outcome(left_arena=bool(seed % 2)),
        "robot": "khepera3",
        "world": "mujoco",
        "conditions": {"damage": ["wheel_gain:wheel=left,factor=0.8"], "seed": seed},
    }
    return Trial(**(values | changes))


TRIALS = (trial(0), trial(1, lost=[2, 3]), trial(2))


@pytest.fixture
def written(tmp_path):
    """A dataset on disk."""
    return dataset.write(
        tmp_path / "data", TRIALS, provenance={"by": "test"}, replicates=[0, 7, 0]
    )


def same(one, other):
    """Whether two trials are equal in all that a dataset keeps."""
    arrays = ("times", "observed", "boundaries")
    return (
        all(getattr(one, a).tobytes() == getattr(other, a).tobytes() for a in arrays)
        and one.commands.values.tobytes() == other.commands.values.tobytes()
        and one.commands.durations.tobytes() == other.commands.durations.tobytes()
        and one.commands.channels == other.commands.channels
        and (one.channels, one.outcome) == (other.channels, other.outcome)
        and (one.robot, one.world) == (other.robot, other.world)
        and one.conditions == other.conditions
    )


def test_what_is_written_is_read_to_the_last_bit(written):
    data = dataset.read(written)
    assert all(map(same, data.trials, TRIALS))
    assert len(data) == 3
    assert (data.replicates, data.numbers) == ((0, 7, 0), (0, 0, 1))
    assert (data.robot, data.provenance) == ("khepera3", {"by": "test"})


def test_the_same_trials_give_the_same_bytes(written, tmp_path):
    again = dataset.write(
        tmp_path / "again", TRIALS, provenance={"by": "test"}, replicates=[0, 7, 0]
    )
    for file in written.iterdir():
        assert file.read_bytes() == (again / file.name).read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["again", "data"]


def test_a_trial_of_the_physics_world_survives(tmp_path):
    from bns.worlds import registry

    world = registry.make("mujoco", reality=["tracker_dropouts:probability=0.3"])
    ran = world.run([Commands([[0.1, 0.05], [0, 0.1]], [1.0, 0.5])], seeds=[3])
    (back,) = dataset.read(dataset.write(tmp_path / "d", ran)).trials
    assert same(back, ran[0])
    assert np.isnan(back.observed).any()


def test_a_trial_without_commands_survives(tmp_path):
    silent = trial(0, commands=Commands(np.zeros((0, 2)), np.zeros(0)), boundaries=[0])
    data = dataset.read(dataset.write(tmp_path / "d", [silent, TRIALS[1]]))
    assert same(data.trials[0], silent)
    assert same(data.trials[1], TRIALS[1])


def test_an_existing_directory_is_never_touched(written):
    before = {file: file.read_bytes() for file in written.iterdir()}
    with pytest.raises(BnsError, match="not overwritten"):
        dataset.write(written, TRIALS)
    assert before == {file: file.read_bytes() for file in written.iterdir()}


def test_a_failed_write_leaves_nothing(tmp_path, monkeypatch):
    def full(path, table):
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(dataset.tables, "write", full)
    with pytest.raises(BnsError, match="No space left"):
        dataset.write(tmp_path / "data", TRIALS)
    assert not list(tmp_path.iterdir())
    monkeypatch.undo()
    with pytest.raises(BnsError, match="No such file"):
        dataset.write(tmp_path / "nowhere" / "data", TRIALS)


def partly_lost(column):
    observed = TRIALS[0].observed.copy()
    observed[4, column] = np.nan
    return trial(0, observed=observed)


BAD_TRIALS = {
    "none": ([], "one trial at least"),
    "a part of the pose lost": ([partly_lost(1)], "y of sample 4 is nan"),
    "a sensor lost": ([partly_lost(3)], "light of sample 4 is nan"),
    "infinite": ([trial(0, observed=np.full((6, 4), np.inf))], "x of sample 0 is inf"),
    "no yaw": (
        [trial(0, channels=(*POSE_CHANNELS[:2], Channel("a", "1"), Channel("b", "1")))],
        "yaw missing",
    ),
    "wrong unit": (
        [trial(0, channels=(Channel("x", "mm"), *TRIALS[0].channels[1:]))],
        "'x' has the unit 'mm', it needs 'm'",
    ),
    "reserved name": (
        [trial(0, channels=(*POSE_CHANNELS, Channel("time", "s")))],
        "reserved",
    ),
    "two robots": ([TRIALS[0], trial(1, robot="other")], "Trial 1 has another robot"),
    "boundary outside": ([trial(0, boundaries=[0, 3, 6])], "outside the 6 samples"),
    "read as JSON": ([trial(0, conditions={"a": {1, 2}})], "cannot be written as JSON"),
}


@pytest.mark.parametrize("case", BAD_TRIALS)
def test_bad_trials_are_not_written(case, tmp_path):
    trials, says = BAD_TRIALS[case]
    with pytest.raises(BnsError, match=says):
        dataset.write(tmp_path / "data", trials)
    assert not list(tmp_path.iterdir())


def header(**changes):
    """A change of the header, as by hand; None removes a key."""

    def change(directory):
        file = directory / "dataset.json"
        new = json.loads(file.read_text()) | {"sha256": None} | changes
        kept = {key: value for key, value in new.items() if value is not None}
        file.write_text(json.dumps(kept))

    return change


def table(name, edit):
    """A change of a table, a dictionary of columns."""

    def change(directory):
        columns = parquet.read_table(directory / name).to_pydict()
        edit(columns)
        parquet.write_table(pyarrow.table(columns), directory / name)

    return change


def put(column, row, value):
    """Put a value into a column."""
    return table(
        "trials.parquet", lambda columns: columns[column].__setitem__(row, value)
    )


def cut(name, size):
    """Shorten a file."""

    def change(directory):
        file = directory / name
        file.write_bytes(file.read_bytes()[:size])

    return change


MM = [{"name": "x", "unit": "mm"}, {"name": "y", "unit": "m"}]
DAMAGED_FILES = {
    "no header": (lambda d: (d / "dataset.json").unlink(), "half-written"),
    "no table": (lambda d: (d / "commands.parquet").unlink(), "is missing"),
    "no directory": (shutil.rmtree, "no dataset"),
    "half a header": (cut("dataset.json", 40), "read as JSON"),
    "half a table": (cut("trials.parquet", 300), "cannot be read as Parquet"),
    "foreign": (header(schema="lerobot"), "schema 'lerobot'"),
    "newer": (header(version=2), "version 2; this release reads 1"),
    "no robot": (header(robot=None), "names no robot"),
    "no channels": (header(channels=None), "'channels' has to list"),
    "wrong unit": (header(channels=MM), "'x' has the unit 'mm'"),
    "missing channel": (header(channels=[MM[1]]), "x, yaw missing"),
    "no trials": (header(trials=None), "'trials' has to list"),
    "other rows": (header(rows={"trials": 3}), "half-written or was edited"),
    "strange flag": (
        header(trials=[{"replicate": 0, "trial": 0, "outcome": {"flew": True}}]),
        "header's differ",
    ),
    "column missing": (
        table("trials.parquet", lambda columns: columns.pop("yaw")),
        "lacks the columns yaw",
    ),
    "column of text": (
        table("trials.parquet", lambda c: c.update(x=["a"] * len(c["x"]))),
        "'x' is string",
    ),
    "null": (put("x", 2, None), "1 nulls"),
    "NaN": (put("x", 2, float("nan")), "x of sample 2 is nan"),
    "time backwards": (put("time", 3, -1.0), "goes backwards"),
    "rows apart": (put("replicate", 2, 7), "not together"),
    "command in the past": (
        table("commands.parquet", lambda c: c["first"].__setitem__(1, 0)),
        "does not begin where the last one ends",
    ),
    "command without time": (
        table("commands.parquet", lambda c: c["duration"].__setitem__(1, 0.0)),
        "must be positive",
    ),
}


@pytest.mark.parametrize("case", DAMAGED_FILES)
def test_a_damaged_dataset_is_refused(case, written):
    change, says = DAMAGED_FILES[case]
    change(written)
    with pytest.raises(FormatError, match=says):
        dataset.read(written)


TOLD = Commands(np.array([[0.1, 0.1], [0.12, -0.05]]), [0.5, 0.3])


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A dataset of two short trials; a sample of the second was lost."""
    world = registry.make("mujoco", robot="khepera3", threads=1, sample_dt=0.05)
    trials = world.run([TOLD, TOLD])
    seen = trials[1].observed.copy()
    seen[3] = np.nan
    trials[1] = trials[1].replace(observed=seen)
    return dataset.write(tmp_path_factory.mktemp("data") / "dataset", trials)


def test_a_lerobot_dataset_is_read_back(data, tmp_path, capsys):
    from bns.gap.importers import tables

    place = tmp_path / "made"
    assert main(["export", str(data), "--out", str(place), "--task", "turn"]) == 0
    assert "2 trials of khepera3" in capsys.readouterr().out
    found = tables.read(place)
    trials = dataset.read(data).trials
    assert found.names[:3] == ("time", "trial", "action.left_speed")
    own = found["trial"] == 0
    np.testing.assert_allclose(found["time"][own], trials[0].times, atol=1e-6)
    x = found["observation.state.x"]
    np.testing.assert_allclose(x[own], trials[0].observed[:, 0], atol=1e-6)
    assert np.isnan(x).sum() == 1
    right = found["action.right_speed"][own]
    np.testing.assert_allclose(right, np.where(trials[0].times < 0.4999, 0.1, -0.05))


def test_its_meta_files_agree_with_its_frames(data, tmp_path):
    from pyarrow import parquet

    main(["export", str(data), "--out", str(tmp_path / "made"), "--fps", "10"])
    info = json.loads((tmp_path / "made" / "meta" / "info.json").read_text())
    lines = (tmp_path / "made" / "meta" / "episodes.jsonl").read_text().splitlines()
    episodes = [json.loads(line) for line in lines]
    assert info["total_episodes"] == len(episodes) == 2 and info["fps"] == 10
    assert info["total_frames"] == sum(row["length"] for row in episodes) == 18
    first = 0
    for row in episodes:
        name = info["data_path"].format(
            episode_chunk=0, episode_index=row["episode_index"]
        )
        table = parquet.read_table(tmp_path / "made" / name)
        assert set(table.column_names) == set(info["features"])
        assert table.num_rows == row["length"]
        index = table["index"].to_numpy()
        assert np.array_equal(index, first + np.arange(row["length"]))
        steps = np.diff(table["timestamp"].to_numpy())
        np.testing.assert_allclose(steps, 0.1, atol=1e-5)
        for name in ("action", "observation.state"):
            (width,) = info["features"][name]["shape"]
            assert len(table[name][0]) == width == len(info["features"][name]["names"])
        first += row["length"]
    stats = (tmp_path / "made" / "meta" / "episodes_stats.jsonl").read_text()
    action = json.loads(stats.splitlines()[0])["stats"]["action"]
    np.testing.assert_allclose(action["max"], [0.12, 0.1], atol=1e-6)
    assert "NaN" not in stats


def test_a_table_has_every_sample_and_unit(data, tmp_path):
    from pyarrow import parquet

    out = tmp_path / "samples.parquet"
    words = ["export", str(data), "--to", "parquet", "--out", str(out)]
    assert main(words) == 0
    table = parquet.read_table(out)
    trials = dataset.read(data).trials
    times = np.concatenate([trial.times for trial in trials])
    np.testing.assert_array_equal(table["time"].to_numpy(), times)
    y = np.concatenate([trial.observed[:, 1] for trial in trials])
    np.testing.assert_array_equal(table["y"].to_numpy(), y)
    assert table.schema.field("command.left_speed").metadata == {b"unit": b"m/s"}
    assert main(words) == WRONG_INPUT  # it is there
