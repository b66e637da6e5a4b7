"""Files made wrong: bits, bytes and pieces, numbers and words, arrays and columns."""

import io
import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

Rng = np.random.Generator

ODD = (
    "NaN", "nan", "inf", "-inf", "Infinity", "1e308", "-1e308", "1e999", "1e30", "-1",
    "0", "-0.0", "1e-300", "9" * 400, "9" * 5000, "9223372036854775808", "true", "null",
    '""', '"text"', "[]", "{}", "[[]]", "1280", "0.5", "\"\\ud83d\\ude00\"", "'a'",
    '"\\u0000"', '"' + "x" * 3000 + '"', "0x7f", "1979-05-27T07:32:00Z",
)  # fmt: skip
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_]{2,}")


def mutated(data: bytes, name: str, rng: Rng) -> bytes:
    """A file of that name made wrong in one way, or in a few."""
    ways: list[Callable[[bytes, Rng], bytes]] = [flip, change, cut, insert, double]
    if name.endswith(".parquet"):
        ways += [columns] * 5
    elif name.endswith(".npz"):
        ways += [members, archive] * 3
    elif not name.endswith((".gz", ".mcap")):
        ways += [number, number, number, number, word, line, nest]
        if name.endswith((".json", ".tuple")):
            ways += [tree] * 6
    for _ in range(1 + int(rng.integers(0, 3) == 0)):
        data = ways[int(rng.integers(len(ways)))](data, rng)
    return data


def flip(data: bytes, rng: Rng) -> bytes:
    """One bit is another."""
    made = bytearray(data)
    if made:
        made[int(rng.integers(len(made)))] ^= 1 << int(rng.integers(8))
    return bytes(made)


def change(data: bytes, rng: Rng) -> bytes:
    """A few bytes are others."""
    made = bytearray(data)
    for _ in range(int(rng.integers(1, 6)) if made else 0):
        made[int(rng.integers(len(made)))] = int(
            rng.choice([0, 7, 27, 34, 128, 255, 91])
        )
    return bytes(made)


def cut(data: bytes, rng: Rng) -> bytes:
    """A piece is missing, often the end."""
    begin, end = sorted(rng.integers(0, len(data) + 1, 2))
    return data[:begin] + (data[end:] if rng.random() < 0.5 else b"")


def insert(data: bytes, rng: Rng) -> bytes:
    """Bytes are put in."""
    at = int(rng.integers(0, len(data) + 1))
    new = rng.integers(0, 256, int(rng.integers(1, 60)), dtype=np.uint8).tobytes()
    return data[:at] + new + data[at:]


def double(data: bytes, rng: Rng) -> bytes:
    """A piece is there twice."""
    begin, end = sorted(rng.integers(0, len(data) + 1, 2))
    return data[:end] + data[begin:end] + data[end:]


def _exchanged(data: bytes, rng: Rng, pattern: re.Pattern[bytes]) -> bytes:
    found = list(pattern.finditer(data))
    if not found:
        return data
    hit = found[int(rng.integers(len(found)))]
    new = ODD[int(rng.integers(len(ODD)))].encode()
    return data[: hit.start()] + new + data[hit.end() :]


def number(data: bytes, rng: Rng) -> bytes:
    """A number is something else."""
    return _exchanged(data, rng, _NUMBER)


def word(data: bytes, rng: Rng) -> bytes:
    """A word is another of the file, or something else."""
    found = [hit.group() for hit in _WORD.finditer(data)]
    if not found or rng.random() < 0.3:
        return _exchanged(data, rng, _WORD)
    one, other = (found[int(rng.integers(len(found)))] for _ in range(2))
    return data.replace(one, other, 1 if rng.random() < 0.7 else -1)


def line(data: bytes, rng: Rng) -> bytes:
    """A line is there twice, or not at all, or elsewhere."""
    lines = data.split(b"\n")
    at = int(rng.integers(len(lines)))
    taken = lines.pop(at)
    for _ in range(int(rng.integers(0, 3))):
        lines.insert(int(rng.integers(len(lines) + 1)), taken)
    return b"\n".join(lines)


def nest(data: bytes, rng: Rng) -> bytes:
    """Something is nested deep."""
    deep = int(rng.choice([70, 2000, 100_000]))
    opens, closes = [(b"[", b"]"), (b'{"a":', b"}"), (b"a.", b"")][int(rng.integers(3))]
    new = opens * deep + b"1" + closes * deep
    found = list(_NUMBER.finditer(data)) or [re.match(b"", data)]
    hit = found[int(rng.integers(len(found)))]
    return data[: hit.start()] + new + data[hit.end() :]


def tree(data: bytes, rng: Rng) -> bytes:
    """A value inside JSON is another; its checksum is left out, as by hand."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        return data
    if not isinstance(content, dict | list):
        return data
    if isinstance(content, dict):
        content.pop("sha256", None)
    place, places = content, [(None, None)]
    waiting = [content]
    while waiting:
        place = waiting.pop()
        keys = range(len(place)) if isinstance(place, list) else list(place)
        for key in keys:
            places.append((place, key))
            if isinstance(place[key], dict | list):
                waiting.append(place[key])
    holder, key = places[int(rng.integers(len(places)))]
    odd = [float("nan"), float("inf"), 1e308, 1e30, -1, 0, 10**400, 2**63, True, None]
    odd += ["", "text", "\ud83d", "\x00\x1b", [], {}, [[1]], {"a": 1}, "y" * 3000]
    new = odd[int(rng.integers(len(odd)))]
    if holder is None:
        content = new
    elif rng.random() < 0.2:
        del holder[key]
    else:
        holder[key] = new
    try:
        return json.dumps(content).encode()
    except (ValueError, RecursionError):
        return data


def members(data: bytes, rng: Rng) -> bytes:
    """An array of an archive is of another type or shape, holds NaN, or is missing."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            held = {name: file[name] for name in file.files}
    except Exception:  # it is damaged already
        return data
    if not held:
        return data
    name = list(held)[int(rng.integers(len(held)))]
    array = held[name]
    new = array.astype(array.dtype, copy=True)
    ways = int(rng.integers(8))
    if ways == 0:
        del held[name]
    elif ways == 1:
        held["more"] = array
    elif ways == 2:
        held[name] = array.astype("U8")
    elif ways == 3:
        held[name] = new[..., None]
    elif ways == 4 and array.ndim:
        held[name] = new[:-1]
    elif array.size and array.dtype.kind in "iuf":
        odd = {5: np.nan, 6: 1e38, 7: -1}[ways] if ways > 4 else 0
        fits = array.dtype.kind == "f"
        new.flat[int(rng.integers(array.size))] = odd if fits else 100
        held[name] = new
    out = io.BytesIO()
    np.savez(out, **held)
    return out.getvalue()


def archive(data: bytes, rng: Rng) -> bytes:
    """An archive claims another size, another packing, or is encrypted."""
    at = [hit.start() for hit in re.finditer(b"PK\x01\x02", data)]
    if not at:
        return data
    made, begin = bytearray(data), at[int(rng.integers(len(at)))]
    way = int(rng.integers(4))
    if way == 0:
        made[begin + 8] |= 1
    elif way == 1:
        made[begin + 10] = int(rng.choice([1, 8, 9, 12, 14, 95]))
    elif way == 2:
        made[begin + 24 : begin + 28] = b"\xfe\xff\xff\xff"
    else:
        made[begin + 42 : begin + 46] = rng.bytes(4)
    return bytes(made)


def columns(data: bytes, rng: Rng) -> bytes:
    """A column of a table is missing, there twice, of another type, or holds NaN."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(pa.BufferReader(data))
    except Exception:  # it is damaged already
        return data
    metadata = dict(table.schema.metadata or {})
    if rng.random() < 0.9:
        metadata.pop(b"sha256", None)
    if not table.num_columns or len(set(table.column_names)) < table.num_columns:
        return data
    at = int(rng.integers(table.num_columns))
    name, column = table.column_names[at], table.column(at)
    way = int(rng.integers(7))
    if way == 0:
        table = table.remove_column(at)
    elif way == 1:
        table = table.append_column(name, column)
    elif way == 2:
        table = table.set_column(at, name, column.cast("string"))
    elif way == 3:
        table = table.slice(0, max(0, table.num_rows - 1))
    elif way == 4:
        table = table.set_column(at, name, pa.nulls(table.num_rows, column.type))
    elif table.num_rows and str(column.type) != "string":
        values = column.to_numpy().copy()
        odd = {5: np.nan, 6: 1e308}[way] if values.dtype.kind == "f" else -5
        values[int(rng.integers(len(values)))] = odd
        table = table.set_column(at, name, pa.array(values))
    sink = pa.BufferOutputStream()
    pq.write_table(table.replace_schema_metadata(metadata), sink)
    return sink.getvalue().to_pybytes()


def strange(path: Path, rng: Rng) -> None:
    """Put something that is no such file in its place; the file is gone already."""
    way = int(rng.integers(5))
    if way == 0:
        path.mkdir()
    elif way == 1:
        os.mkfifo(path)
    elif way == 2:
        path.symlink_to("/dev/zero")
    elif way == 3:
        with path.open("wb") as file:
            file.truncate(6 << 30)  # a hole: it takes no room
    else:
        path.symlink_to(path)
