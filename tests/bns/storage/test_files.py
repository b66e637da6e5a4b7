"""Files are whole or as they were, read once and within bounds; one process writes.

Without pyarrow tables are NPZ, and what is read is the same.
"""

import errno
import io
import json
import os
import sys
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from bns.__main__ import WRONG_INPUT, main
from bns.errors import LONGEST, BnsError, FormatError
from bns.storage import arrays, files, parquet, reading, seal, tables
from bns.storage.lock import Lock
from bns.storage.store import load
from bns.worlds.data import dataset


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("[" * 100_000, "nested too deep"),
        ("[" * 70 + "]" * 70, "deeper than 64"),
        ("9" * 400, "64"),
        ('{"a": NaN}', "cannot be read as JSON"),
        ('{"a": "\\ud83d"}', "cannot be read as JSON"),
    ],
)
def test_json_that_python_would_choke_on_is_one_line(text, match):
    with pytest.raises(FormatError, match=match) as caught:
        reading.json(text, "a file")
    assert len(str(caught.value)) <= LONGEST and str(caught.value).isprintable()


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 5000,
        "a = " + "9" * 5000,
        "a = 1\na = 2",
        "a." * 100_000 + "b = 1",
    ],
)
def test_toml_that_python_would_choke_on_is_one_line(text):
    with pytest.raises(FormatError) as caught:
        reading.toml(text, "a file")
    assert len(str(caught.value)) <= LONGEST and str(caught.value).isprintable()


def test_what_is_no_regular_file_is_not_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe", "/dev/zero"):
        with pytest.raises(FormatError, match="no regular file"):
            reading.read_bytes(path)
    with pytest.raises(FormatError, match="cannot be read: No such file"):
        reading.read_bytes(tmp_path / "none")


def test_a_file_that_is_too_large_is_told_so(tmp_path):
    with (tmp_path / "hole").open("wb") as file:
        file.truncate(reading.TEXT + 1)
    with pytest.raises(FormatError, match="16 MiB is the most"):
        reading.read_text(tmp_path / "hole")


def packed(**member):
    """An archive with one member, some of whose facts are others."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", member.get("kind", zipfile.ZIP_STORED)) as archive:
        data = io.BytesIO()
        np.save(data, np.zeros(3))
        archive.writestr("a.npy", data.getvalue())
    return out.getvalue()


def test_an_archive_that_claims_gibibytes_is_not_unpacked(tmp_path):
    data = bytearray(packed())
    at = data.index(b"PK\x01\x02")
    data[at + 24 : at + 28] = b"\xfe\xff\xff\xff"
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(FormatError, match="claims 4 GiB"):
        arrays.read_npz(tmp_path / "a.npz", most=1 << 20)


def test_encrypted_and_rarely_packed_archives_are_refused(tmp_path):
    data = bytearray(packed())
    data[data.index(b"PK\x01\x02") + 8] |= 1
    for content in (bytes(data), packed(kind=zipfile.ZIP_LZMA)):
        (tmp_path / "a.npz").write_bytes(content)
        with pytest.raises(FormatError, match="encrypted or packed"):
            arrays.read_npz(tmp_path / "a.npz")


def test_an_array_is_as_large_as_its_head_says(tmp_path):
    data = packed().replace(b"(3,), ", b"(2,), ")
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(FormatError, match=r"CRC|says it holds"):
        arrays.read_npz(tmp_path / "a.npz")


def test_a_flipped_table_is_refused_by_its_name(tmp_path):
    path = tmp_path / "table.parquet"
    parquet.write(path, {"a": np.arange(2000) / 7})
    data = bytearray(path.read_bytes())
    data[200] ^= 1
    path.write_bytes(data)
    with pytest.raises(FormatError, match=r"table\.parquet"):
        parquet.read(path)


def test_a_table_without_checksum_is_read_with_a_warning(tmp_path, caplog):
    pq.write_table(pa.table({"a": [1.0]}), tmp_path / "old.parquet")
    assert parquet.read(tmp_path / "old.parquet")["a"].to_pylist() == [1.0]
    assert "carries no checksum" in caplog.text


def test_files_of_one_directory_without_checksum_warn_once(tmp_path, caplog):
    for place in ("one", "other"):
        (tmp_path / place).mkdir()
        for name in ("a.parquet", "b.parquet"):
            pq.write_table(pa.table({"a": [1.0]}), tmp_path / place / name)
            parquet.read(tmp_path / place / name)
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 2
    assert str(tmp_path / "one") in said[0] and str(tmp_path / "other") in said[1]


def test_a_column_twice_is_refused(tmp_path):
    table = pa.table([[1.0], [2.0]], names=["a", "a"])
    pq.write_table(table, tmp_path / "t.parquet")
    with pytest.raises(FormatError, match="'a' is there twice"):
        parquet.read(tmp_path / "t.parquet")


def test_a_seal_notices_what_was_changed(tmp_path, caplog):
    path = tmp_path / "a.json"
    files.write_json(path, {"seed": 12, "text": "\U0001f600", "x": [0.1, None]})
    content = reading.read_json(path)
    assert seal.opened(content, path)["seed"] == 12 and not caplog.text
    path.write_text(path.read_text().replace("12", "13", 1))
    with pytest.raises(FormatError, match="damaged"):
        seal.opened(reading.read_json(path), path)
    seal.opened({"seed": 13}, path)
    assert "carries no checksum" in caplog.text


def test_sealed_toml_stays_toml(tmp_path):
    text = seal.sealed_text('a = "x"\n')
    assert reading.toml(text, "f") == {"a": "x"}
    assert seal.opened_text(text, "f") == 'a = "x"\n'
    with pytest.raises(FormatError, match="first line"):
        seal.opened_text(text.replace("x", "y"), "f")


def test_a_full_disk_costs_nothing_that_was_there(tmp_path, monkeypatch):
    path = tmp_path / "a.json"
    files.write_json(path, {"old": 1})
    before = path.read_bytes()

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(files.StorageError, match="No space left"):
        files.write_json(path, {"new": 2})
    assert path.read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == ["a.json"]


def test_devices_are_not_replaced_and_links_are_followed(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(files.StorageError, match="no file"):
        files.write_bytes(tmp_path / "pipe", b"x")
    (tmp_path / "link").symlink_to(tmp_path / "far")
    files.write_bytes(tmp_path / "link", b"x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "far").read_bytes() == b"x"


def test_one_writer_at_a_time(tmp_path):
    place = tmp_path / "a" / "b"
    with Lock(place):
        with pytest.raises(BnsError, match="another process"):
            Lock(place).take()
        (place / "x").write_text("")
    with Lock(place):
        assert json.loads("1") == 1
    assert place.is_dir()


def test_a_directory_made_for_nothing_goes_again(tmp_path):
    place = tmp_path / "a" / "b"
    with pytest.raises(BnsError, match="stop"), Lock(place):
        raise BnsError("stop")
    assert not any(tmp_path.iterdir())


def test_messages_are_short_lines_of_text():
    said = str(FormatError("a\x1b[31m\n" + "x" * 5000 + " what to do"))
    assert len(said) <= LONGEST and said.isprintable() and said.endswith("what to do")


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
