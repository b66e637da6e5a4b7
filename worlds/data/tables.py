"""The two tables of a dataset, to and from files."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from bns.errors import BnsError, FormatError
from bns.storage import tables
from bns.worlds.trial import Channel, Commands, Trial

Table = dict[str, np.ndarray]

SAMPLE_KEYS = {"replicate": "int64", "trial": "int64", "time": "double"}
COMMAND_KEYS = {
    "replicate": "int64",
    "trial": "int64",
    "first": "int64",
    "last": "int64",
    "duration": "double",
}


def numbers(replicates: Sequence[int]) -> list[int]:
    """Number of each trial in its replicate, from 0."""
    seen: dict[int, int] = {}
    found = []
    for replicate in replicates:
        found.append(seen.get(replicate, 0))
        seen[replicate] = found[-1] + 1
    return found


def of_samples(
    trials: Sequence[Trial], replicates: Sequence[int], numbers: Sequence[int]
) -> Table:
    """Columns with one row per sample.

    Args:
        trials: N trials with the same channels.
        replicates: number of the replicate of each.
        numbers: number of each trial in its replicate.
    """
    observed = np.concatenate([trial.observed for trial in trials])
    names = [channel.name for channel in trials[0].channels]
    return {
        **_keys(replicates, numbers, [len(trial.times) for trial in trials]),
        "time": np.concatenate([trial.times for trial in trials]),
        **{name: observed[:, index] for index, name in enumerate(names)},
    }


def of_commands(
    trials: Sequence[Trial], replicates: Sequence[int], numbers: Sequence[int]
) -> Table:
    """Columns with one row per command.

    Args:
        trials: N trials with the same commands' channels.
        replicates: number of the replicate of each.
        numbers: number of each trial in its replicate.
    """
    values = np.concatenate([trial.commands.values for trial in trials])
    names = [channel.name for channel in trials[0].commands.channels]
    return {
        **_keys(replicates, numbers, [len(trial.commands) for trial in trials]),
        "first": np.concatenate([trial.boundaries[:-1] for trial in trials]),
        "last": np.concatenate([trial.boundaries[1:] for trial in trials]),
        "duration": np.concatenate([trial.commands.durations for trial in trials]),
        **{name: values[:, index] for index, name in enumerate(names)},
    }


def _keys(
    replicates: Sequence[int], numbers: Sequence[int], counts: Sequence[int]
) -> Table:
    """Replicate and trial of each row, of which each trial has so many."""
    return {
        "replicate": np.repeat(np.asarray(replicates, np.int64), counts),
        "trial": np.repeat(np.asarray(numbers, np.int64), counts),
    }


def write(path: Path, table: Table) -> None:
    """Write columns to a file, always the same bytes; see `bns.storage.tables`.

    Raises:
        StorageError: no space, or no permission.
    """
    columns = {name: np.ascontiguousarray(column) for name, column in table.items()}
    tables.write(
        path,
        columns,
        use_dictionary=False,
        column_encoding={
            name: "BYTE_STREAM_SPLIT"
            if column.dtype == np.float64
            else "DELTA_BINARY_PACKED"
            for name, column in columns.items()
        },
    )


def read(path: Path, keys: dict[str, str], channels: Sequence[Channel]) -> Table:
    """Read the columns that a dataset's table needs.

    Args:
        path: of the Parquet file.
        keys: columns beside the channels, with their Arrow type.
        channels: with one column of doubles each.

    Raises:
        FormatError: no such file, not Parquet, damaged, a column missing, twice or of
            another type.
    """
    if not tables.exists(path):
        raise FormatError(f"{path} is missing; the dataset is half-written.")
    return tables.read(path, keys, {channel.name: "double" for channel in channels})


def split(
    table: Table,
    keys: Sequence[tuple[int, int]],
    path: Path,
    *,
    allow_empty: bool = False,
) -> Iterator[Table]:
    """The rows of each trial, in the order of `keys` (replicate, trial).

    Args:
        table: with the columns ``replicate`` and ``trial``.
        keys: replicate and trial of each, all different.
        path: of the table, for messages.
        allow_empty: whether a trial may have no rows.

    Raises:
        FormatError: rows of another trial, of one in two places, or of none.
    """
    pair = np.stack([table["replicate"], table["trial"]], axis=1)
    edges = np.flatnonzero((np.diff(pair, axis=0) != 0).any(axis=1)) + 1
    starts = np.concatenate([[0], edges]) if len(pair) else np.array([], int)
    stops = np.concatenate([edges, [len(pair)]])
    places: dict[tuple[int, int], slice] = {}
    for start, stop in zip(starts, stops, strict=False):
        key = (int(pair[start, 0]), int(pair[start, 1]))
        if key in places:
            raise FormatError(f"{path}: rows of trial {key} are not together.")
        places[key] = slice(int(start), int(stop))
    unknown = set(places) - set(keys)
    absent = set(keys) - set(places)
    if unknown or (absent and not allow_empty) or len(set(keys)) != len(keys):
        raise FormatError(
            f"{path}: its trials (replicate, trial) and the header's differ, at "
            f"{sorted(unknown | absent)[:3]}."
        )
    for key in keys:
        rows = places.get(key, slice(0, 0))
        yield {name: column[rows] for name, column in table.items()}


def trial(
    samples: Table,
    commands: Table,
    channels: Sequence[Channel],
    told: Sequence[Channel],
    where: str,
) -> Trial:
    """One trial from its rows.

    Args:
        samples: the trial's rows of the table of samples.
        commands: its rows of the table of commands.
        channels: what was observed.
        told: what was commanded.
        where: the trial's place, for messages.

    Raises:
        FormatError: rows that make no trial.
    """
    first, last = commands["first"], commands["last"]
    if (first[1:] != last[:-1]).any():
        raise FormatError(f"{where}: a command does not begin where the last one ends.")
    try:
        return Trial(
            commands=Commands(
                _stacked(commands, told), commands["duration"], tuple(told)
            ),
            times=samples["time"],
            observed=_stacked(samples, channels),
            boundaries=np.concatenate([first[:1] if len(first) else [0], last]),
            channels=tuple(channels),
        )
    except BnsError as error:
        raise FormatError(f"{where}: {error}") from None


def _stacked(table: Table, channels: Sequence[Channel]) -> np.ndarray:
    rows = len(table["replicate"])
    columns = [table[channel.name] for channel in channels]
    return np.stack(columns, axis=1) if columns else np.zeros((rows, 0))
