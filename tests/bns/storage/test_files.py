"""Files are whole or as they were, read once and within bounds; one process writes."""

import errno
import io
import json
import os
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from bns.errors import LONGEST, BnsError, FormatError
from bns.storage import arrays, files, parquet, reading, seal
from bns.storage.lock import Lock


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
    "text", ["a = " + "[" * 5000, "a = " + "9" * 5000, "a = 1\na = 2"]
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
