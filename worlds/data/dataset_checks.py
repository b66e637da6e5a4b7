"""What makes a dataset valid, with errors that say what is wrong where."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import BnsError, FormatError
from bns.worlds.trial import (
    POSE,
    POSE_CHANNELS,
    WHEEL_CHANNELS,
    Channel,
    Outcome,
    Trial,
)

UNITS = {channel.name: channel.unit for channel in (*POSE_CHANNELS, *WHEEL_CHANNELS)}
FARTHEST = {"m": 1e6, "rad": 1e6}
"""how far a pose may be from the origin, by unit"""

STRONGEST = 1e6
"""magnitude of a command, in its unit"""

LONGEST = 1e9  # [s] a trial, 32 years
APART = 1.0  # [s] by which commands may be longer or shorter than their samples say
RESERVED = ("replicate", "trial", "time", "first", "last", "duration")


def fit_together(trials: Sequence[Trial], replicates: Sequence[int]) -> None:
    """Stop if trials cannot be one dataset.

    Raises:
        BnsError: none at all, other numbers of replicates, different robots or
            channels.
        FormatError: a trial is not valid.
    """
    if not trials:
        raise BnsError("A dataset needs one trial at least; none was given.")
    if len(replicates) != len(trials):
        raise BnsError(
            f"{len(replicates)} replicates were given for {len(trials)} trials: give "
            "one for each."
        )
    first = trials[0]
    channel_units(first.channels, "observed channels")
    channel_units(first.commands.channels, "command channels")
    missing_pose(first.channels, "observed channels")
    for index, trial in enumerate(trials):
        same = (
            trial.robot == first.robot
            and tuple(trial.channels) == tuple(first.channels)
            and tuple(trial.commands.channels) == tuple(first.commands.channels)
        )
        if not same:
            raise BnsError(
                f"Trial {index} has another robot or other channels than trial 0; "
                "write one dataset for each."
            )
        valid(trial, f"trial {index}")


def valid(trial: Trial, where: str) -> None:
    """Stop if a trial's samples are not as a dataset's have to be.

    Raises:
        FormatError: NaN outside lost samples, infinity, time that is not finite or
            goes backwards, boundaries that are no samples; poses, times or commands
            beyond what they can be; commands that are not as long as their samples.
    """
    if not np.isfinite(trial.times).all():
        raise FormatError(f"{where}: a time is NaN or infinite.")
    if (np.diff(trial.times) < 0).any():
        row = int(np.flatnonzero(np.diff(trial.times) < 0)[0]) + 1
        raise FormatError(
            f"{where}: time goes backwards at sample {row}; sort the samples by time."
        )
    names = [channel.name for channel in trial.channels]
    seen = trial.poses_world if POSE[0] in names else trial.observed
    lost = np.isnan(seen).all(axis=1)
    wrong = ~np.isfinite(trial.observed) & ~lost[:, None]
    if wrong.any() or np.isinf(trial.observed).any():
        row, column = np.argwhere(wrong | np.isinf(trial.observed))[0]
        raise FormatError(
            f"{where}: {trial.channels[column].name} of sample {row} is "
            f"{trial.observed[row, column]}; only a lost sample may be NaN, in all of "
            f"{', '.join(POSE)}."
        )
    bounds = trial.boundaries
    inside = len(trial.times) and bounds[0] >= 0 and bounds[-1] < len(trial.times)
    if not inside or (np.diff(bounds) < 0).any():
        raise FormatError(
            f"{where}: commands begin or end outside the {len(trial.times)} samples, "
            "or overlap."
        )
    plausible(trial, where)


def plausible(trial: Trial, where: str) -> None:
    """Stop at numbers that no robot can have made.

    Raises:
        FormatError: there is one.
    """
    if len(trial.times) and np.abs(trial.times).max() > LONGEST:
        raise FormatError(f"{where}: a time is beyond {LONGEST:g} s; times are in s.")
    for column, channel in enumerate(trial.channels):
        known = FARTHEST if channel.name in POSE else {}
        most = known.get(channel.unit, float(np.finfo(np.float32).max))
        seen = np.abs(trial.observed[:, column])
        if np.nanmax(seen, initial=0.0) > most:
            raise FormatError(
                f"{where}: {channel.name} is {np.nanmax(seen):.3g} {channel.unit}, "
                f"{most:g} is the most that is read; units are SI."
            )
    told = np.abs(trial.commands.values)
    if told.max(initial=0.0) > STRONGEST:
        raise FormatError(
            f"{where}: a command is {told.max():.3g}, {STRONGEST:g} is the most that "
            "is read; units are SI."
        )
    held = trial.times[trial.boundaries]
    late = np.abs(np.diff(held) - trial.commands.durations)
    longest = APART + 0.5 * trial.commands.durations
    if (late > longest).any():
        at = int(np.argmax(late - longest))
        raise FormatError(
            f"{where}: command {at} says {trial.commands.durations[at]:.4g} s, its "
            f"samples {held[at + 1] - held[at]:.4g} s; times and durations are in s."
        )


def channel_units(channels: Sequence[Channel], where: str) -> None:
    """Stop at a channel listed twice, with a reserved name or with a wrong unit.

    Raises:
        FormatError: there is one.
    """
    names = [name for name, _ in channels]
    for name, unit in channels:
        if name in RESERVED or names.count(name) > 1:
            raise FormatError(f"{where}: {name!r} is listed twice or is reserved.")
        if unit != UNITS.get(name, unit):
            raise FormatError(
                f"{where}: {name!r} has the unit {unit!r}, it needs {UNITS[name]!r}; "
                "convert it (bns.worlds.data.importing does)."
            )


def missing_pose(channels: Sequence[Channel], where: str) -> None:
    """Stop if a part of the pose is missing; a robot on a stand has no pose at all.

    Raises:
        FormatError: some of x, y and yaw are there and some not, or no channel at all.
    """
    names = [name for name, _ in channels]
    missing = [name for name in POSE if name not in names]
    if missing and not (len(missing) == len(POSE) and names):
        raise FormatError(
            f"{where}: {', '.join(missing)} missing; there are {', '.join(names)}."
        )


def channels(header: dict, key: str, where: Path) -> tuple[Channel, ...]:
    """The channels that a header lists under `key`.

    Raises:
        FormatError: they are missing, malformed or in wrong units.
    """
    try:
        found = tuple(
            Channel(_text(item["name"]), _text(item["unit"])) for item in header[key]
        )
    except (KeyError, TypeError):
        raise FormatError(
            f"{where}: {key!r} has to list channels as objects with name and unit."
        ) from None
    channel_units(found, f"{where}: {key}")
    if key == "channels":
        missing_pose(found, f"{where}: {key}")
    return found


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError("no text")
    return value


def rows(header: dict, samples: int, commands: int, where: Path) -> None:
    """Stop if tables are shorter or longer than the header says.

    Args:
        header: of the dataset.
        samples: number of rows of the table of samples.
        commands: number of rows of the table of commands.
        where: file that the message names.

    Raises:
        FormatError: they are.
    """
    found = {"trials": samples, "commands": commands}
    if header.get("rows") != found:
        raise FormatError(
            f"{where}: the tables hold {found} rows, the header says "
            f"{header.get('rows')}; it is half-written or was edited."
        )


def listed_trials(header: dict, where: Path) -> list[dict]:
    """The header's entries about each trial.

    Raises:
        FormatError: they are missing or malformed.
    """
    items: Any = header.get("trials")
    fine = isinstance(items, list) and all(
        isinstance(item, dict)
        and type(item.get("replicate")) is int
        and type(item.get("trial")) is int
        and isinstance(item.get("conditions", {}), dict)
        for item in items
    )
    if not fine:
        raise FormatError(
            f"{where}: 'trials' has to list objects with replicate and trial."
        )
    return items


def flags(about: dict, where: Path) -> dict[str, Any]:
    """Outcome flags and counters of a trial.

    Raises:
        FormatError: an unknown one, no truth value, no count.
    """
    given = about.get("outcome", {})
    known = Outcome._fields
    kinds = {name: type(value) for name, value in Outcome._field_defaults.items()}
    if not isinstance(given, dict) or not all(
        name in known and type(value) is kinds[name] and 0 <= value <= LONGEST
        for name, value in given.items()
    ):
        raise FormatError(
            f"{where}: outcome {given!r} is not understood; flags are "
            f"{', '.join(known)}."
        )
    return given


def handled(about: dict, commands: int, where: Path) -> list[bool]:
    """Which commands of a trial the robot was handled in.

    Args:
        about: the trial's entry in the header.
        commands: number of commands of the trial.
        where: file that the message names.

    Raises:
        FormatError: no list of indices of commands.
    """
    given = about.get("handled", [])
    fine = isinstance(given, list) and all(
        type(index) is int and 0 <= index < commands for index in given
    )
    if not fine:
        raise FormatError(
            f"{where}: handled {given!r} is not understood; it lists indices of the "
            f"{commands} commands."
        )
    return [index in set(given) for index in range(commands)]
