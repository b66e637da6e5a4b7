"""Logs of a user's own robot: columns of commands and observations by channel."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from scipy.interpolate import PchipInterpolator

from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import SENT, TIME, TRIAL, Column, Table
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.recordings import trial_conditions
from bns.worlds.data import dataset_checks as checks
from bns.worlds.data.importing import MOMENTS, Source
from bns.worlds.data.units import factor
from bns.worlds.trial import Commands, Trial

RATES = (1.0, 50_000.0)  # [Hz] of samples
LATE = 0.5  # samples by which a command may be sent after its first row
BETWEEN = "between"  # column of rows that were lost
LOST = 1.75  # steps between rows from which one is lost, and not late
LONGEST = 0.5  # [s] without a row over which commands are taken to go on
FARTHEST = 5.0  # times a joint's range
USUAL = 0.9  # quantile of what was seen of a joint: some samples are wild
HELD = 2, 10  # samples that a loop of its own holds its commands: who tells anew at
# each sample logs what it tells, as does a list of steps that are held for long


def read(path: str, config: OwnConfig) -> list[Trial]:
    """Trials of a log that `bns.gap.importers.tables` knows.

    Columns are named like the channels, beside `time` [s] and, if there are,
    `trial` and `command_time` [s]; [log] in the description names others. A stretch of
    equal commands becomes one command, which begins at its `command_time`, else with
    its first row; commands that are held for a few rows may then have begun since the
    row before, unless rows of commands hold no readings: these have stamps of their
    own. Empty cells of readings are lost samples, those of commands hold the last one.

    Raises:
        FormatError: no such file, a column missing, or time going backwards.
    """
    table = tables.read(path)
    columns = channels(table, config, path)
    told = [item.channel.name for item in config.told]
    _empty(columns, config, path)
    parts = [filled(columns, told, rows) for rows in split(columns[TRIAL])]
    return [
        _trial(bridged(part, told), config, f"{path}, trial {number}")
        for number, part in enumerate(parts)
    ]


def filled(
    columns: Mapping[str, np.ndarray], told: Sequence[str], rows: np.ndarray
) -> dict[str, np.ndarray]:
    """Some rows of a log; what was told is held over cells that are empty, and rows
    before the first command are left out.

    Args:
        columns: of the log, ``(T,)`` each.
        told: names of those that are commands.
        rows: that are wanted; all stay, where a command has no value at all.
    """
    made = {name: values[rows] for name, values in columns.items()}
    first = 0
    for name in told:
        given = np.isfinite(made[name])
        if given.any() and not given.all():
            last = np.maximum.accumulate(np.where(given, np.arange(len(given)), -1))
            made[name] = made[name][np.maximum(last, 0)]
            first = max(first, int(np.argmax(given)))
    return {name: values[first:] for name, values in made.items()}


def bridged(
    columns: Mapping[str, np.ndarray], told: Sequence[str]
) -> Mapping[str, np.ndarray]:
    """Columns with rows where some were lost and commands change from row to row: what
    was told meanwhile is taken to go on smoothly (monotone cubics), not to stand still.

    Args:
        columns: of a trial, ``(T,)`` each.
        told: names of those that are commands.

    Returns:
        the same, if none were lost, else with `BETWEEN`, 1 in such a row.
    """
    times = columns[TIME]
    apart = np.diff(times)
    if SENT in columns or len(times) < 4 or not (apart > 0).all():
        return columns
    step = float(np.median(apart))
    changed = np.any([np.diff(columns[name]) != 0 for name in told], axis=0)
    steady = np.append(changed[1:], True) & np.append(True, changed[:-1]) & changed
    missing = np.rint(apart / step).astype(int) - 1
    missing[~steady | (apart < LOST * step) | (apart > LONGEST)] = 0
    if not missing.any():
        return columns
    after = np.repeat(np.arange(len(apart)), missing)
    count = np.concatenate([np.arange(1, n + 1) / (n + 1) for n in missing if n])
    new = times[after] + count * apart[after]
    made = {}
    for name, values in columns.items():
        between = np.full(len(new), np.nan)
        if name == TIME:
            between = new
        elif name in told:
            between = PchipInterpolator(times, values)(new)
        made[name] = np.insert(values.astype(float), after + 1, between)
    return made | {BETWEEN: np.insert(np.zeros(len(times)), after + 1, 1.0)}


def _empty(columns: Mapping[str, np.ndarray], config: OwnConfig, path: str) -> None:
    """Stop at a channel without a number.

    Raises:
        FormatError: there is one.
    """
    kinds = {item.channel.name: "commands" for item in config.told}
    kinds |= {item.channel.name: "observed" for item in config.seen}
    for name, kind in kinds.items():
        if not np.isfinite(columns[name]).any():
            raise FormatError(
                f"{path}: {name} holds no number; take [{kind}.{name!r}] out of the "
                "description."
            )


def possible(trials: Sequence[Trial], config: OwnConfig, model: mujoco.MjModel) -> None:
    """Stop at joints that come far beyond the range that the model gives them.

    Args:
        trials: of a log.
        config: the description.
        model: the nominal model.

    Raises:
        FormatError: there is one; its column is in another unit.
    """
    for column, item in enumerate(config.seen):
        if item.quantity != "joint" or not model.joint(item.part).limited:
            continue
        values = np.concatenate([trial.observed[:, column] for trial in trials])
        values = values[np.isfinite(values)]
        most = float(np.abs(model.joint(item.part).range).max())
        size = float(np.quantile(np.abs(values), USUAL)) if len(values) else 0.0
        if size > FARTHEST * most:
            name, unit = item.channel
            raise FormatError(
                f"{name} comes to {size:.3g} {unit}, and joint {item.part!r} of the "
                f"model no farther than {most:.3g}: give the unit of its column, "
                f'[log] "{name}" = {{ column = "{name}", unit = "deg" }} or "mm".'
            )


def channels(table: Table, config: OwnConfig, path: str) -> dict[str, np.ndarray]:
    """Columns of a log by channel, in SI units, and `time`, `trial`, `command_time`.

    Args:
        table: the log's columns.
        config: which column is which channel, and its unit.
        path: of the log, for messages.

    Returns:
        each ``(T,)``; without a column of trials all are trial 0.

    Raises:
        FormatError: a column is missing.
    """
    found = {}
    told = [item.channel.name for item in config.told]
    seen = [item.channel.name for item in config.seen]
    for name in (TIME, *told, *seen):
        source = config.log.get(name)
        column = source.column if source else name
        if column not in table:
            raise FormatError(
                f"{path} has no column {column!r} for {name!r}; it has "
                f"{', '.join(table.names)}. Name it in [log] or in a map "
                "(--columns)."
            )
        found[name] = table[column] * _scale(source)
    for name in (TRIAL, SENT):
        source = config.log.get(name)
        column = source.column if source else name
        if column in table:
            found[name] = table[column] * _scale(source)
    found.setdefault(TRIAL, np.zeros(len(found[TIME])))
    return found


def _scale(source: Source | None) -> float:
    """What a column is multiplied by for SI."""
    return source.scale * factor(source.unit) if source else 1.0


def split(marks: np.ndarray) -> list[np.ndarray]:
    """Rows of each trial: a new mark begins a new one."""
    edges = np.flatnonzero(np.diff(marks) != 0) + 1
    return np.split(np.arange(len(marks)), edges)


def _trial(columns: Mapping[str, np.ndarray], config: OwnConfig, where: str) -> Trial:
    exact = SENT in columns
    columns = _exact(columns, config, where)
    times = columns[TIME] - columns[TIME][:1]
    if not np.isfinite(times).all():
        row = int(np.flatnonzero(~np.isfinite(times))[0])
        raise FormatError(f"{where}: no time in its sample {row}.")
    tables.forward(columns[TIME], where)
    if len(times) < 2:
        raise FormatError(f"{where}: fewer than two samples.")
    _rated(times, where)
    told = np.stack([columns[item.channel.name] for item in config.told], axis=1)
    seen = np.stack([columns[item.channel.name] for item in config.seen], axis=1)
    seen[~np.isfinite(seen).all(axis=1)] = np.nan
    good = np.isfinite(seen).all(axis=1)
    for column, item in enumerate(config.seen):
        if item.turning:
            seen[good, column] = np.unwrap(seen[good, column])
    if not np.isfinite(told).all():
        row, column = np.argwhere(~np.isfinite(told))[0]
        name = config.told[column].channel.name
        raise FormatError(f"{where}: {name} is missing in its sample {row}.")
    change = (np.diff(told[:-1], axis=0) != 0).any(axis=1)
    begins = np.concatenate([[0], np.flatnonzero(change) + 1])
    begins = begins[np.diff(times[np.append(begins, len(times) - 1)]) > 0]
    bounds = np.append(begins, len(times) - 1)
    exact |= _stamped(seen, begins[1:])
    exact |= not HELD[0] <= np.median(np.diff(bounds)) <= HELD[1]
    kinds = tuple(item.channel for item in config.told)
    conditions: dict[str, object] = {} if exact else {MOMENTS: "sampled"}
    if BETWEEN in columns:
        lost = np.isin(begins, np.flatnonzero(columns[BETWEEN]))
        conditions[trial_conditions.BETWEEN] = times[begins[lost]].tolist()
    made = Trial(
        commands=Commands(told[begins], np.diff(times[bounds]), kinds),
        times=times,
        observed=seen,
        boundaries=bounds,
        channels=tuple(item.channel for item in config.seen),
        robot=config.name,
        world="imported",
        conditions=conditions,
    )
    checks.plausible(made, where)
    return made


def _rated(times: np.ndarray, where: str) -> None:
    """Stop at stamps that no log of a robot has.

    Raises:
        FormatError: samples come too seldom or too often.
    """
    steps = np.diff(times)
    rate = 1 / max(float(np.median(steps[steps > 0])), 1e-12) if steps.any() else 0.0
    if not RATES[0] <= rate <= RATES[1]:
        raise FormatError(
            f"{where}: {rate:.3g} samples a second, and {RATES[0]:g} to {RATES[1]:g} "
            "are read: is the unit of `time` right? Give it in the description, "
            '[log] time = { column = "...", unit = "ms" }, or "s", "us", "ns".'
        )


def _stamped(seen: np.ndarray, begins: np.ndarray) -> bool:
    """Whether commands have rows of their own, at their own times.

    Args:
        seen: readings, ``(T, C)``.
        begins: rows in which a command begins, ``(n,)``.
    """
    lost = ~np.isfinite(seen).any(axis=1)
    return bool(len(begins) and lost[begins].mean() > USUAL > lost.mean())


def _exact(
    columns: Mapping[str, np.ndarray], config: OwnConfig, where: str
) -> Mapping[str, np.ndarray]:
    """The columns with commands at the time they were sent, if that is known.

    Raises:
        FormatError: a command sent after its first row, or before the one before.
    """
    if SENT not in columns:
        return columns
    names = [item.channel.name for item in config.told]
    told = np.stack([columns[name] for name in names], axis=1)
    times, sent = columns[TIME], columns[SENT]
    rows = np.append(0, np.flatnonzero((np.diff(told, axis=0) != 0).any(axis=1)) + 1)
    moments = np.append(times[0], sent[rows[1:]])
    late = LATE * float(np.median(np.diff(times)))  # of stamps that jitter
    wrong = (moments > times[rows] + late) | (np.diff(moments, prepend=-np.inf) < 0)
    if wrong.any() or not np.isfinite(moments).all():
        row = int(rows[np.argmax(wrong | ~np.isfinite(moments))])
        raise FormatError(
            f"{where}: command_time is {sent[row]:.6g} s in row {row}, the first with "
            f"its command, of {times[row]:.6g} s; a command is sent before its row and "
            "after the command before it."
        )
    seen = [
        Column(item.channel.name, columns[item.channel.name]) for item in config.seen
    ]
    given = [Column(name, columns[name][rows]) for name in names]
    joint, made = tables.joined(times, seen, moments, given)
    return {TIME: joint, **{column.name: column.values for column in made}}
