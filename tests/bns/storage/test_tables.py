"""Without pyarrow tables are NPZ, and what is read is the same."""

import sys

import numpy as np
import pytest

from bns.__main__ import WRONG_INPUT, main
from bns.errors import FormatError
from bns.storage import arrays, tables
from bns.storage.store import load
from bns.worlds.data import dataset

KEYS = {"trial": "int64"}
COLUMNS = {"trial": np.arange(3), "fitness": np.array([0.5, np.nan, np.inf])}


@pytest.fixture
def no_pyarrow(monkeypatch):
    """As where the extra `tables` is not installed."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "pyarrow"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pyarrow", None)


def test_a_table_comes_back_as_it_was(tmp_path, no_pyarrow):
    path = tmp_path / "record.parquet"
    assert not tables.exists(path)
    tables.write(path, COLUMNS)
    assert [p.name for p in tmp_path.iterdir()] == ["record.npz"] and tables.exists(
        path
    )
    found = tables.read(path, KEYS)
    for name, column in COLUMNS.items():
        assert found[name].dtype == column.dtype
        np.testing.assert_array_equal(found[name], column)
    assert list(tables.read(path, KEYS, {})) == ["trial"]
    first = (tmp_path / "record.npz").read_bytes()
    tables.write(path, COLUMNS)
    assert (tmp_path / "record.npz").read_bytes() == first


@pytest.mark.parametrize(
    ("changed", "match"),
    [
        ({"trial": np.zeros(3)}, "'trial' is float64, it needs int64"),
        ({"fitness": np.zeros(3, np.float32)}, "'fitness' is float32, it needs double"),
        ({"fitness": np.zeros(2)}, "differ in shape"),
        ({"trial": np.zeros((3, 1), int), "fitness": np.zeros((3, 1))}, "in shape"),
    ],
)
def test_arrays_that_are_no_such_table_are_refused(tmp_path, changed, match):
    tables.write_plain(tmp_path / "a.parquet", COLUMNS | changed)
    with pytest.raises(FormatError, match=match):
        tables.read(tmp_path / "a.parquet", KEYS)


def test_a_column_that_was_lost_is_noticed(tmp_path):
    tables.write_plain(tmp_path / "a.parquet", COLUMNS)
    held = arrays.read_npz(tmp_path / "a.npz")
    for name in ("fitness", tables.KEY):
        left = {key: array for key, array in held.items() if key != name}
        arrays.write_npz(tmp_path / "a.npz", left)
        with pytest.raises(FormatError, match=r"a\.npz is damaged"):
            tables.read(tmp_path / "a.parquet", KEYS)


def test_a_column_that_is_missing_is_named(tmp_path):
    tables.write_plain(tmp_path / "a.parquet", COLUMNS)
    with pytest.raises(FormatError, match="lacks the columns yaw; it has trial, fitn"):
        tables.read(tmp_path / "a.parquet", KEYS, {"yaw": "double"})


def test_a_run_without_pyarrow_holds_the_same(fakes, tmp_path, no_pyarrow, monkeypatch):
    fakes.train(tmp_path / "npz")
    monkeypatch.undo()
    fakes.train(tmp_path / "parquet")
    one, other = load(tmp_path / "npz"), load(tmp_path / "parquet")
    assert (tmp_path / "npz" / "record.npz").is_file()
    assert not list((tmp_path / "npz").rglob("*.parquet"))
    for name, column in one.columns.items():
        np.testing.assert_array_equal(column, other.columns[name])
    found = [dataset.read(tmp_path / place / "dataset") for place in ("npz", "parquet")]
    assert found[0].numbers == found[1].numbers
    for one, other in zip(found[0].trials, found[1].trials, strict=True):
        np.testing.assert_array_equal(one.observed, other.observed)
        np.testing.assert_array_equal(one.commands.values, other.commands.values)


def test_a_finished_run_without_pyarrow_is_left_alone(fakes, tmp_path, no_pyarrow):
    fakes.train(tmp_path / "run")
    before = {p: p.read_bytes() for p in (tmp_path / "run").rglob("*.npz")}
    fakes.train(tmp_path / "run", resume=True)
    assert {p: p.read_bytes() for p in (tmp_path / "run").rglob("*.npz")} == before


def test_half_a_table_is_refused(fakes, tmp_path, no_pyarrow):
    fakes.train(tmp_path / "run")
    for path in (tmp_path / "run/record.npz", tmp_path / "run/dataset/trials.npz"):
        path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(FormatError, match=r"record\.npz cannot be read as NPZ"):
        load(tmp_path / "run")
    with pytest.raises(FormatError, match=r"trials\.npz cannot be read as NPZ"):
        dataset.read(tmp_path / "run" / "dataset")


def test_a_parquet_file_without_pyarrow_says_what_to_install(
    fakes, tmp_path, request, capsys
):
    fakes.train(tmp_path / "run")
    request.getfixturevalue("no_pyarrow")
    assert (
        main(["compare", str(tmp_path / "run"), str(tmp_path / "run")]) == WRONG_INPUT
    )
    said = capsys.readouterr().err
    assert "install 'bns-testbed[tables]'" in said and said.count("\n") == 1
