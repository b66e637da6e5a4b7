"""Hashes of what files say, not of the containers they say it in."""

import base64
import hashlib
import html
import json
import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet

Hashes = dict[str, str]
Text = Callable[[str], str]

DEPTH = 2
"""nested mappings are told apart by key so deep; what lies deeper is one hash"""
MAY_DIFFER = {"versions", "commit", "cores", "machine", "python", "bns", "mujoco"}
MAY_DIFFER |= {"numpy", "scipy", "torch", "pyarrow", "rerun-sdk", "ray"}
MAY_DIFFER |= {"sha256", "revision"}  # of content that has versions in it
MAY_DIFFER |= {"seconds", "date", "time", "at", "started", "finished", "engine"}
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_TABLE = re.compile(r"<table.*?</table>", re.DOTALL)
_FIGURE = re.compile(r"data:image/svg\+xml;base64,([A-Za-z0-9+/=]+)")
_PATH = re.compile(r'\bd="([^"]*)"')


def of_directory(directory: Path, *roots: Path) -> dict[str, Hashes]:
    """Hashes by file and part (column, array, key) of all that is read here.

    Args:
        directory: what a command wrote.
        roots: paths that are left out of texts, as they differ from place to place.
    """

    def without(text: str) -> str:
        for root in roots:
            text = text.replace(str(root), "")
        return text

    files = sorted(path for path in directory.rglob("*") if path.is_file())
    names = [str(path.relative_to(directory)) for path in files]
    found = {"(files)": {"names": digest("\n".join(names).encode())}}
    for name, path in zip(names, files, strict=True):
        read = READERS.get(path.suffix)
        if read and path.name not in SKIPPED:
            found[name] = read(path, without)
    return found


def digest(content: bytes) -> str:
    """Ten hexadecimal digits: to tell apart, not to protect."""
    return hashlib.sha256(content).hexdigest()[:10]


def npz(path: Path, without: Text) -> Hashes:
    """A hash an array, of its type, shape and bytes."""
    del without
    with np.load(path, allow_pickle=False) as arrays:
        return {name: array(arrays[name]) for name in sorted(arrays)}


def array(values: np.ndarray) -> str:
    """Hash of an array's type, shape and bytes."""
    head = f"{values.dtype.str} {values.shape} ".encode()
    return digest(head + np.ascontiguousarray(values).tobytes())


def table(path: Path, without: Text) -> Hashes:
    """A hash a column, of its type and values."""
    content = parquet.read_table(path)
    found = {}
    for name in sorted(content.column_names):
        column = content.column(name)
        values = without(repr(column.to_pylist()))
        found[name] = digest(f"{column.type} {values}".encode())
    return found


def text(path: Path, without: Text) -> Hashes:
    """One hash of the text."""
    return {"text": digest(without(path.read_text()).encode())}


def document(path: Path, without: Text) -> Hashes:
    """A hash a key, of what JSON says; times, versions and places are left out."""
    return mapping(json.loads(without(path.read_text())))


def settings(path: Path, without: Text) -> Hashes:
    """A hash a section, of what TOML says."""
    return mapping(tomllib.loads(without(path.read_text())), depth=1)


def mapping(content: Mapping[str, object], *, depth: int = DEPTH) -> Hashes:
    """A hash a key, by dotted name; lists of mappings are told apart by key."""
    found: Hashes = {}
    for name, value in sorted(content.items()):
        if name in MAY_DIFFER:
            continue
        value = _columns(value)
        if isinstance(value, Mapping) and value and depth > 1:
            inner = mapping(value, depth=depth - 1)
            found |= {f"{name}.{key}": one for key, one in inner.items()}
        else:
            kept = json.dumps(_kept(value), sort_keys=True)
            found[name] = digest(kept.encode())
    return found


def page(path: Path, without: Text) -> Hashes:
    """A hash a table and a figure, of the numbers in it; not of the prose."""
    content = without(path.read_text())
    tables = [part for part in _TABLE.findall(content) if ">commit<" not in part]
    found = {f"table {n:02}": _numbers(part) for n, part in enumerate(tables)}
    for number, encoded in enumerate(_FIGURE.findall(content)):
        drawn = base64.b64decode(encoded).decode()
        paths = "\n".join(_PATH.findall(drawn))
        found[f"figure {number:02}"] = digest(paths.encode())
    return found


READERS: dict[str, Callable[[Path, Text], Hashes]] = {
    ".npz": npz,
    ".parquet": table,
    ".json": document,
    ".toml": settings,
    ".csv": text,
    ".html": page,
}
SKIPPED = ("timing.jsonl", "versions.json")


def _numbers(part: str) -> str:
    shown = html.unescape(re.sub(r"<[^>]+>", " ", part))
    return digest(" ".join(_NUMBER.findall(shown)).encode())


def _columns(value: object) -> object:
    """A list of mappings with the same keys as a mapping of lists."""
    if not isinstance(value, list) or not value:
        return value
    if not all(isinstance(item, Mapping) for item in value):
        return value
    names = {name for item in value for name in item}
    return {name: [item.get(name) for item in value] for name in names}


def _kept(value: object) -> object:
    if isinstance(value, Mapping):
        return {k: _kept(v) for k, v in value.items() if k not in MAY_DIFFER}
    if isinstance(value, list):
        return [_kept(item) for item in value]
    return value
