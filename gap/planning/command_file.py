"""Commands in a table that people and robots can read: CSV, SI units.

The first column is `duration` [s], the others are command channels; their units stand
in the head as `left_speed [m/s]`.
"""

import csv
import re
from pathlib import Path

from bns.errors import BnsError, FormatError
from bns.worlds.trial import Channel, Commands

DURATION = "duration [s]"
_HEAD = re.compile(r"(?P<name>\S+) \[(?P<unit>[^\]]+)\]")


def write(commands: Commands, path: str | Path) -> Path:
    """Write a list of commands.

    Raises:
        BnsError: the file can not be written.
    """
    head = [DURATION, *(f"{name} [{unit}]" for name, unit in commands.channels)]
    rows = zip(commands.durations.tolist(), commands.values.tolist(), strict=True)
    try:
        with Path(path).open("w", newline="", encoding="utf-8") as out:
            table = csv.writer(out, lineterminator="\n")
            table.writerow(head)
            table.writerows([f"{d:.10g}", *(f"{v:.10g}" for v in r)] for d, r in rows)
    except OSError as error:
        raise BnsError(f"{path} cannot be written: {error.strerror}.") from error
    return Path(path)


def read(path: str | Path) -> Commands:
    """Read what `write` wrote.

    Raises:
        FormatError: there is no such file, or it is no such table.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8") as file:
            head, *rows = list(csv.reader(file))
        heads = [_HEAD.fullmatch(cell.strip()) for cell in head]
        if not heads or not all(heads) or head[0].strip() != DURATION:
            raise FormatError(
                f"{path}: the head has to be {DURATION!r} and the channels with units, "
                "as in 'left_speed [m/s]'."
            )
        channels = tuple(Channel(m["name"], m["unit"]) for m in heads[1:] if m)
        table = [[float(cell) for cell in row] for row in rows if row]
        durations = [row[0] for row in table]
        return Commands([row[1:] for row in table], durations, channels)
    except (OSError, ValueError, IndexError) as error:
        raise FormatError(f"{path} holds no commands ({error}).") from None
