"""Trials written for other tools hold what was recorded."""

import json

import numpy as np
import pytest

from bns.__main__ import WRONG_INPUT, main
from bns.worlds import registry
from bns.worlds.data import dataset
from bns.worlds.trial import Commands

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
