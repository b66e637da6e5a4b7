"""Commands in a table that people and robots can read: CSV, SI units.

The first column is `duration` [s], the others are command channels; their units stand
in the head as `left_speed [m/s]`.
"""

import csv
import io
import re
from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.storage import files, reading
from bns.worlds.data.dataset_checks import STRONGEST, channel_units
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
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(head)
    table.writerows([f"{d:.10g}", *(f"{v:.10g}" for v in r)] for d, r in rows)
    files.write_text(path, out.getvalue())
    return Path(path)


def read(path: str | Path) -> Commands:
    """Read what `write` wrote.

    Raises:
        FormatError: there is no such file, or it is no such table.
    """
    text = reading.read_text(path)
    try:
        head, *rows = list(csv.reader(io.StringIO(text, newline="")))
        heads = [_HEAD.fullmatch(cell.strip()) for cell in head]
        if not heads or not all(heads) or head[0].strip() != DURATION:
            raise FormatError(
                f"{path}: the head has to be {DURATION!r} and the channels with units, "
                "as in 'left_speed [m/s]'."
            )
        channels = tuple(Channel(m["name"], m["unit"]) for m in heads[1:] if m)
        channel_units(channels, str(path))
        table = [[float(cell) for cell in row] for row in rows if row]
        durations = [row[0] for row in table]
        made = Commands([row[1:] for row in table], durations, channels)
    except FormatError:
        raise
    except (csv.Error, *reading.UNREADABLE) as error:
        raise FormatError(f"{path} holds no commands: {error}.") from error
    strongest = max(np.abs(made.values).max(initial=0), made.durations.max(initial=0))
    if strongest > STRONGEST or not len(made):
        raise FormatError(
            f"{path} holds no commands, or one beyond {STRONGEST:g}; units are SI."
        )
    return made
