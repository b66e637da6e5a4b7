"""The description of a robot from its MJCF and a log: what is what is found out.

`describe` gives the TOML file of docs/gap_your_robot.md, what was guessed, and what it
is unsure about; `bns gap describe` prints the same.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bns.errors import BnsError, FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column
from bns.gap.models.mjcf import begin, guesses, matching
from bns.gap.models.mjcf.channels import (
    Work,
    commands,
    compiled,
    tolds,
)
from bns.gap.models.mjcf.config import WINDOW
from bns.gap.models.mjcf.log import filled, split
from bns.gap.models.mjcf.measured import observed
from bns.worlds.data.units import FACTORS, factor, si_unit


@dataclass(frozen=True)
class Description:
    """What `describe` found.

    Attributes:
        toml: text of the description.
        guessed: what was guessed, one line each.
        unsure: what had better be looked at, one line each.
    """

    toml: str
    guessed: tuple[str, ...]
    unsure: tuple[str, ...]

    def write(self, path: str | Path) -> Path:
        """Write the description; gives the file.

        Raises:
            BnsError: there is one already, or the file can not be written.
        """
        path = Path(path)
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(self.toml)
        except FileExistsError:
            raise BnsError(
                f"{path} exists and is not overwritten; give another --out."
            ) from None
        except OSError as error:
            raise BnsError(f"{path} cannot be written: {error.strerror}.") from None
        return path


def describe(
    model: str | Path,
    log: str | Path,
    *,
    out: str | Path = "",
    kp: float | Sequence[float] = 0.0,
    kd: float | Sequence[float] = 0.0,
    torque: float | Sequence[float] = np.inf,
) -> Description:
    """Describe a robot.

    Args:
        model: its MJCF file.
        log: of a kind that `bns.gap.importers.tables` knows.
        out: where the description will lie; the model is named from there. Empty: in
            the working directory, under the model's name.
        kp, kd: gains of a position loop that the robot has and its MJCF has not
            [N m/rad, N m s/rad]; one for all commands, or one for each in the order of
            the log.
        torque: largest torque or force of that loop [N m or N]; the same.

    Raises:
        FormatError: a file that cannot be read, or without times or commands.
        BnsError: no column can be told, a loop is needed, or it has another number of
            gains than there are commands.
    """
    given = {"kp": kp, "kd": kd, "torque": torque}
    loop = {key: tuple(map(float, np.atleast_1d(v))) for key, v in given.items()}
    if not any(loop["kp"]):
        if any(loop["kd"]) or np.isfinite(loop["torque"]).any():
            raise BnsError("--kd and --torque are of a position loop: give its --kp.")
        loop = {}
    work = Work(
        Path(model), str(log), tables.read(log), loop, compiled(Path(model), ())
    )
    work.guessed.extend(work.table.notes)
    _clock(work)
    told, seen = _columns(work)
    told = _filled(work, told)
    commands(work, told, seen)
    observed(work, seen)
    begin.hold(work)
    begin.begin(work)
    return Description(
        toml(work, place(model, out)), tuple(work.guessed), tuple(work.unsure)
    )


def place(model: str | Path, out: str | Path = "") -> Path:
    """Where a description lies: `out`, or the model's name in the working directory."""
    return Path(out) if str(out) else Path(f"{Path(model).stem}.toml")


def _clock(work: Work) -> None:
    """Columns of time, trial and command_time."""
    names = work.table.names
    clock = matching.clock(names)
    if not clock:
        rising = [c.name for c in work.table.columns if _rises(c.values)]
        if not rising:
            raise FormatError(
                f"{work.log} has no column of times that grow; it has "
                f"{', '.join(names)}. Call one time."
            )
        clock = rising[0]
        work.unsure.append(f"time: column {clock!r}, for it grows")
    trial = matching.one_of(names, matching.TRIALS)
    marks = work.table[trial] if trial else np.zeros(len(work.table[clock]))
    work.rows = split(marks)
    longest = max(work.rows, key=len)
    unit = matching.unit(clock)
    unit = (
        unit if unit in FACTORS["s"] else guesses.time_unit(work.table[clock][longest])
    )
    work.times = work.table[clock] * FACTORS["s"][unit]
    if not np.isfinite(work.times).all():
        row = int(np.argmin(np.isfinite(work.times)))
        raise FormatError(f"{work.log}: the time in {clock!r} is missing in row {row}.")
    tables.forward(work.table[clock][longest], work.log, repr(clock))
    steps = np.diff(work.times[longest])
    rate = 1 / max(float(np.median(steps[steps > 0])), 1e-9) if (steps > 0).any() else 0
    if rate <= 0:
        raise FormatError(f"{work.log}: time stands still in {clock!r}.")
    work.guessed.append(f"time: {clock!r} in {unit}, {rate:.4g} samples a second")
    work.sources[tables.TIME] = (clock, unit)
    if trial:
        work.sources[tables.TRIAL] = (trial, "")
    work.guessed.append(f"trials: {len(work.rows)}" + (f", by {trial!r}" * bool(trial)))
    sent = matching.one_of(names, matching.SENT)
    if sent:
        work.sources[tables.SENT] = (sent, unit)
        work.guessed.append(f"commands were sent at {sent!r}, in {unit}")


def _rises(values: np.ndarray) -> bool:
    return (
        len(values) > 1
        and bool((np.diff(values) >= 0).mean() > 0.99)
        and bool(np.ptp(values) > 0)
    )


def _columns(work: Work) -> tuple[list[Column], list[Column]]:
    """Columns that are told and seen, times and counters left out."""
    used = {column for column, _ in work.sources.values()}
    rest = [
        column
        for column in work.table.columns
        if column.name not in used and column.name.lower() not in matching.COUNTS
    ]
    empty = [column for column in rest if not np.isfinite(column.values).any()]
    work.unsure.extend(f"{c.name}: holds no number, left out" for c in empty)
    rest = [column for column in rest if column not in empty]
    model = work.model
    actuators = [model.actuator(a).name for a in range(model.nu)]
    joints = [model.joint(j).name for j in range(model.njnt)]
    told, seen = matching.roles(rest, actuators, joints)
    if not told:
        told, why = matching.second_choice(seen, actuators)
        seen = [column for column in seen if column not in told]
        if why:
            listed = ", ".join(column.name for column in told)
            work.unsure.append(f"commands: {listed}, for {why}")
    if not told:
        raise BnsError(
            f"No column of {work.log} is a command; it has "
            f"{', '.join(work.table.names)}. Call commands as the actuator, or "
            "JOINT_goal."
        )
    return told, seen


def _filled(work: Work, told: Sequence[Column]) -> list[Column]:
    """Commands that are held over empty cells; rows before the first are left out."""
    count = len(work.times)
    columns = {column.name: column.values for column in told}
    names = [*columns]
    parts = [filled(columns | {"": np.arange(count)}, names, r) for r in work.rows]
    rows = [part[""].astype(int) for part in parts]
    made = []
    for column in told:
        values = column.values.copy()
        for part, at in zip(parts, rows, strict=True):
            values[at] = part[column.name]
        made.append(replace(column, values=values))
    before = sum(map(len, work.rows)) - sum(map(len, rows))
    empty = np.isnan([column.values for column in told]).any(axis=0).sum() - before
    if before:
        work.guessed.append(f"commands: {before} rows before the first are left out")
    if empty:
        work.guessed.append(f"commands: held over the empty cells of {empty} rows")
    work.rows = rows
    return made


def toml(work: Work, out: Path) -> str:
    """The description of a robot as the text of a TOML file.

    Args:
        work: what was found in the model and the log.
        out: where the file will be; the model's path is relative to it.
    """
    model = os.path.relpath(work.path.resolve(), out.resolve().parent)
    lines = [
        f"# By `bns gap describe {work.path.name} {Path(work.log).name}`; see "
        "docs/gap_your_robot.md.",
        *(f"# Unsure: {line}" for line in work.unsure),
        f"name = {_text(work.path.stem)}",
        f"model = {_text(Path(model).as_posix())}",
    ]
    steps = np.diff(work.times[max(work.rows, key=len)])
    step = float(np.median(steps[steps > 0]))
    if work.held:
        lines.append(f"held = {json.dumps(work.held, ensure_ascii=False)}")
    window = _window(work, step)
    if window != WINDOW:
        lines.append(f"window = {window:.4g}")
    for item in tolds(work):
        lines += _table(
            f"commands.{_text(item.channel.name)}",
            {
                "actuator": item.actuator,
                "unit": item.channel.unit,
                "low": item.low,
                "high": item.high,
                **{
                    key: getattr(item, key)
                    for key in work.loop
                    if np.isfinite(getattr(item, key))
                },
            },
        )
    for column, part, unit in work.seen:
        pieces = [column.values[rows] * factor(unit) for rows in work.rows]
        axis = {"axis": part.axis} if part.axis else {}
        noise = float(f"{guesses.noise(pieces):.3g}")
        given = {
            part.quantity: part.name,
            **axis,
            "unit": si_unit(unit),
            "noise": noise,
        }
        lines += _table(f"observed.{_text(work.channel(column, unit))}", given)
    if work.start:
        lines += _table("start", work.start)
    return "\n".join([*lines, *_log(work)]) + "\n"


def _window(work: Work, step: float) -> float:
    """Time between comparisons [s]: the usual one, or as long as commands are held.

    Args:
        work: what was found.
        step: time between samples [s].
    """
    rows = max(work.rows, key=len)
    told = np.stack([c.values[rows] for c, _, _ in work.told], axis=1)
    changes = np.flatnonzero(guesses.changed(told))
    held = float(np.median(np.diff(changes))) * step if len(changes) > 1 else WINDOW
    return max(2 * step, min(held, WINDOW) if held >= 2 * step else WINDOW)


def _log(work: Work) -> list[str]:
    """[log]: columns that are called otherwise, or are not in SI units."""
    lines = {}
    for name, (column, unit) in work.sources.items():
        if column != name or unit not in ("", "s"):
            lines[name] = (column, unit)
    for item, _, unit in (*work.told, *work.seen):
        name = work.channel(item, unit)
        if name != item.name or factor(unit) != 1.0:
            lines[name] = (item.name, unit)
    made = ["", "[log]"] if lines else []
    for name, (column, unit) in lines.items():
        more = f", unit = {_text(unit)}" if unit else ""
        made.append(f"{_text(name)} = {{ column = {_text(column)}{more} }}")
    return made


def _table(head: str, values: dict) -> list[str]:
    lines = ["", f"[{head}]"]
    for key, value in values.items():
        if isinstance(value, float):
            lines.append(f"{key} = {float(f'{value:.6g}')!r}")
        else:
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")
    return lines


def _text(value: str) -> str:
    """A TOML string, or a bare key's text in quotes."""
    return json.dumps(value, ensure_ascii=False)
