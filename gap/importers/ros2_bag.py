"""MCAP files as they are recorded: one, or a directory of rosbag2 with parts of one."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bns.errors import FormatError
from bns.storage import reading
from bns.worlds.data import mcap_log

MAGIC = b"\x89MCAP0\r\n"
NUMBER = re.compile(r"_\d+$")  # of a part
Log = list[tuple[tuple[int, int], Any]]


@dataclass(frozen=True)
class Bag:
    """A recording.

    Attributes:
        path: as it was given.
        files: its parts, in their order.
        kinds: of each part, schema by topic; topics without messages are left out.
        counts: messages by topic, of all parts.
    """

    path: Path
    files: tuple[Path, ...]
    kinds: tuple[dict[str, str], ...]
    counts: dict[str, int]

    @property
    def topics(self) -> dict[str, str]:
        """Schema by topic."""
        return {topic: schema for part in self.kinds for topic, schema in part.items()}

    def messages(self, wanted: set[str]) -> dict[str, Log]:
        """Per topic, in order: ((log time, publish time) [ns], message).

        Raises:
            MissingDependencyError: what decodes its messages.
            FormatError: a part cannot be read.
        """
        found: dict[str, Log] = {topic: [] for topic in wanted}
        for file, kinds in zip(self.files, self.kinds, strict=True):
            here = wanted & set(kinds)
            for topic, log in (mcap_log.messages(file, here) if here else {}).items():
                found[topic] += log
        return found


def opened(path: Path) -> Bag:
    """The recording in a file or a directory.

    Raises:
        MissingDependencyError: the package `mcap`.
        FormatError: empty, cut off, no MCAP, or parts of several recordings.
    """
    files = _files(path)
    kinds, counts = [], dict[str, int]()
    for file in files:
        _complete(file)
        heard = mcap_log.topics(file)
        kinds.append({topic: schema for topic, (schema, _) in heard.items()})
        for topic, (_, count) in heard.items():
            counts[topic] = counts.get(topic, 0) + count
    return Bag(path, tuple(files), tuple(kinds), counts)


def _files(path: Path) -> list[Path]:
    """The file, or those of a directory in the order of their numbers."""
    if not path.is_dir():
        return [path]
    found = sorted(path.glob("*.mcap"), key=_order)
    if len({NUMBER.sub("", file.stem) for file in found}) > 1:
        raise FormatError(
            f"{path} holds MCAP files of several recordings: give one of "
            f"{', '.join(str(file) for file in found[:4])}."
        )
    return found


def _order(path: Path) -> list[tuple[int, str]]:
    pieces = re.split(r"(\d+)", path.stem)
    return [(int(p) if p.isdecimal() else 0, p) for p in pieces]


def _complete(path: Path) -> None:
    """Stop at a file that lacks its end.

    Raises:
        FormatError: empty, or cut off.
    """
    with reading.regular(path) as file:
        begin = file.read(len(MAGIC))
        size = file.seek(0, 2)
        file.seek(max(size - len(MAGIC), 0))
        end = file.read()
    if not size:
        raise FormatError(f"{path} is empty: it was no recording that was ended.")
    if begin == MAGIC and (end != MAGIC or size < 2 * len(MAGIC)):
        mended = path.with_suffix(".whole.mcap")
        raise FormatError(
            f"{path} ends before its end record, for its recording was cut off: run "
            f"`mcap recover {path} -o {mended}`, then give {mended}."
        )
