"""CSV logs of a user's own robot: columns of commands and observations by channel."""

from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.gap.models.mjcf.config import OwnConfig
from bns.storage import csv_table
from bns.worlds.data import dataset_checks as checks
from bns.worlds.data.column_map import FACTORS
from bns.worlds.trial import Commands, Trial


def read(path: str, config: OwnConfig) -> list[Trial]:
    """Trials of a table of samples, one row each, with a line of column names.

    Columns are named like the channels, beside `time` [s] and, if there is one,
    `trial`; [log] in the description names others. A stretch of equal commands
    becomes one command. Empty cells are lost samples.

    Raises:
        FormatError: no such file, a column missing, or time going backwards.
    """
    if not Path(path).exists():
        raise FormatError(f"{path} is neither a dataset directory nor a log.")
    table = csv_table.read(path)
    needed = [item.channel.name for item in (*config.told, *config.seen)]
    columns = {}
    for name in ("time", *needed):
        source = config.log.get(name)
        column = source.column if source else name
        if column not in table:
            raise FormatError(
                f"{path} has no column {column!r} for {name!r}; it has "
                f"{', '.join(table)}. Name it in [log]."
            )
        columns[name] = table[column] * _factor(source.unit if source else "")
    label = config.log["trial"].column if "trial" in config.log else "trial"
    marks = table.get(label, np.zeros(len(columns["time"])))
    edges = np.flatnonzero(np.diff(marks) != 0) + 1
    return [
        _trial({n: v[rows] for n, v in columns.items()}, config, f"{path}, trial {k}")
        for k, rows in enumerate(np.split(np.arange(len(marks)), edges))
    ]


def _factor(unit: str) -> float:
    for row in FACTORS.values():
        if unit in row:
            return row[unit]
    return 1.0


def _trial(columns: dict[str, np.ndarray], config: OwnConfig, where: str) -> Trial:
    times = columns["time"] - columns["time"][:1]
    if len(times) < 2 or not (np.diff(times) >= 0).all():
        raise FormatError(f"{where}: fewer than two samples, or time goes backwards.")
    told = np.stack([columns[item.channel.name] for item in config.told], axis=1)
    seen = np.stack([columns[item.channel.name] for item in config.seen], axis=1)
    seen[~np.isfinite(seen).all(axis=1)] = np.nan
    if not np.isfinite(told).all():
        raise FormatError(f"{where}: a command is missing in some rows.")
    change = (np.diff(told[:-1], axis=0) != 0).any(axis=1)
    begins = np.concatenate([[0], np.flatnonzero(change) + 1])
    begins = begins[np.diff(times[np.append(begins, len(times) - 1)]) > 0]
    bounds = np.append(begins, len(times) - 1)
    channels = tuple(item.channel for item in config.told)
    made = Trial(
        commands=Commands(told[begins], np.diff(times[bounds]), channels),
        times=times,
        observed=seen,
        boundaries=bounds,
        channels=tuple(item.channel for item in config.seen),
        robot=config.name,
        world="imported",
    )
    checks.plausible(made, where)
    return made
