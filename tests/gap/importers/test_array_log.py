"""Parquet tables and NPZ archives as people write them, and directories of tables."""

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from bns.errors import FormatError
from bns.gap.importers import tables

TIMES = np.arange(5) / 100


def frame(path, **columns):
    parquet.write_table(pyarrow.table(columns), path)
    return tables.read(path)


def test_a_parquet_table_of_a_data_frame_is_read(tmp_path):
    found = frame(
        tmp_path / "a.parquet",
        time=TIMES,
        q=[[1.0, 2.0]] * 5,
        robot=["arm"] * 5,
        goal=np.arange(5),
        __index_level_0__=np.arange(5),
    )
    assert found.names == ("time", "q0", "q1", "goal")
    np.testing.assert_array_equal(found["q1"], [2.0] * 5)
    assert found.notes == ("left out, not 5 numbers: robot",)


def test_moments_in_it_are_seconds(tmp_path):
    moments = np.datetime64("2025-11-28T03:20:00", "us") + np.arange(3) * 10_000
    found = frame(tmp_path / "a.pq", stamp=moments, q=[1, 2, 3])
    np.testing.assert_allclose(found["stamp"], [0, 0.01, 0.02])


def test_arrays_of_an_archive_are_columns(tmp_path):
    np.savez(
        tmp_path / "a.npz",
        t=TIMES,
        q=np.ones((5, 2)),
        goal=np.zeros((5, 1), np.float32),
        rate=100.0,
        joints=np.array(["hip", "knee"]),
    )
    found = tables.read(tmp_path / "a.npz")
    assert found.names == ("t", "q0", "q1", "goal")
    assert found.notes == ("left out, not 5 numbers: rate, joints",)


def test_what_is_no_table_is_said_with_what_it_holds(tmp_path):
    np.savez(tmp_path / "a.npz", q=np.ones((2, 5, 3)))
    with pytest.raises(FormatError, match=r"a.npz is no table: .* q \(2, 5, 3\)"):
        tables.read(tmp_path / "a.npz")


@pytest.mark.parametrize("name", ["a.npz", "a.parquet"])
def test_a_damaged_one_is_said(tmp_path, name):
    (tmp_path / name).write_bytes(b"PK")
    with pytest.raises(FormatError, match=f"{name} cannot be read as"):
        tables.read(tmp_path / name)


def written(path, *rows, names="time,goal,q"):
    path.write_text("\n".join([names, *rows]) + "\n")


def test_each_file_of_a_directory_is_a_trial_in_the_order_of_numbers(tmp_path):
    for number in (10, 9, 1):
        written(tmp_path / f"run_{number}.csv", f"0,1,{number}", f"0.1,1,{number}")
    written(tmp_path / "summary.csv", "1,2", "3,4", names="mean,sd")
    found = tables.read(tmp_path)
    np.testing.assert_array_equal(found["q"], [1, 1, 9, 9, 10, 10])
    np.testing.assert_array_equal(found["trial"], [0, 0, 1, 1, 2, 2])
    assert found.notes == (
        "summary.csv: left out, its columns are not those of the others",
    )


def test_trials_within_the_files_stay_apart(tmp_path):
    names = "time,trial,q"
    written(tmp_path / "a.csv", "0,0,1", "0.1,0,1", "0,1,2", "0.1,1,2", names=names)
    written(tmp_path / "b.csv", "0,0,3", "0.1,0,3", names=names)
    np.testing.assert_array_equal(tables.read(tmp_path)["trial"], [0, 0, 1, 1, 2, 2])


def test_a_dataset_of_ours_is_no_such_directory(tmp_path):
    (tmp_path / "dataset.json").write_text("{}")
    written(tmp_path / "a.csv", "0,1,2")
    assert tables.reader(tmp_path) is None
