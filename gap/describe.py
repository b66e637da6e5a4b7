"""The description of a robot from its MJCF and a log: what is what is found out.

`describe` gives the TOML file of docs/gap_your_robot.md, what was guessed, and what it
is unsure about; `bns gap describe` prints the same.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from bns.errors import BnsError, FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column, Table
from bns.gap.models.mjcf import guesses, matching, prepared, rehearsal
from bns.gap.models.mjcf.config import WINDOW, OwnConfig, Told
from bns.gap.models.mjcf.log import split
from bns.gap.models.mjcf.rehearsal import Part
from bns.worlds.data.column_map import FACTORS
from bns.worlds.trial import Channel

REHEARSED = 5.0  # [s] of the first trial that the nominal model moves along
AGREES = 0.5  # score from which on a column moves as the model says
ALIKE = 0.1  # two parts whose scores are nearer cannot be told apart


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
            raise BnsError(f"{path} exists and is not overwritten.") from None
        except OSError as error:
            raise BnsError(f"{path} cannot be written: {error.strerror}.") from None
        return path


@dataclass(eq=False)
class _Work:
    """What is known so far; grows step by step."""

    path: Path
    log: str
    table: Table
    loop: dict[str, float]
    model: mujoco.MjModel
    sources: dict[str, tuple[str, str]] = field(default_factory=dict)
    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rows: list[np.ndarray] = field(default_factory=list)
    told: list[tuple[Column, str, str]] = field(default_factory=list)
    seen: list[tuple[Column, Part, str]] = field(default_factory=list)
    guessed: list[str] = field(default_factory=list)
    unsure: list[str] = field(default_factory=list)
    start: dict[str, object] = field(default_factory=dict)


def describe(
    model: str | Path,
    log: str | Path,
    *,
    out: str | Path = "",
    kp: float = 0.0,
    kd: float = 0.0,
    torque: float = np.inf,
) -> Description:
    """Describe a robot.

    Args:
        model: its MJCF file.
        log: of a kind that `bns.gap.importers.tables` knows.
        out: where the description will lie; the model is named from there. Empty: in
            the working directory, under the model's name.
        kp, kd: gains of a position loop that the robot has and its MJCF has not.
        torque: largest torque or force of that loop.

    Raises:
        FormatError: a file that cannot be read, or without times or commands.
        BnsError: no column can be told, or a loop is needed.
    """
    loop = {"kp": kp, "kd": kd, "torque": torque} if kp else {}
    work = _Work(
        Path(model), str(log), tables.read(log), loop, _compiled(Path(model), ())
    )
    _clock(work)
    told, seen = _columns(work)
    _commands(work, told, seen)
    _observed(work, seen)
    _begin(work)
    return Description(
        _toml(work, place(model, out)), tuple(work.guessed), tuple(work.unsure)
    )


def place(model: str | Path, out: str | Path = "") -> Path:
    """Where a description lies: `out`, or the model's name in the working directory."""
    return Path(out) if str(out) else Path(f"{Path(model).stem}.toml")


def _compiled(path: Path, told: Sequence[Told]) -> mujoco.MjModel:
    if not path.is_file():
        raise FormatError(f"There is no model file {path}.")
    try:
        return prepared.spec(OwnConfig(path.stem, path, tuple(told), ())).compile()
    except ValueError as error:
        first = str(error).strip().splitlines()[0]
        raise FormatError(f"{path}: {first}") from None


def _clock(work: _Work) -> None:
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
    steps = np.diff(work.times[longest])
    rate = 1 / max(float(np.median(steps[steps > 0])), 1e-9) if (steps > 0).any() else 0
    if rate <= 0 or (steps < 0).any():
        raise FormatError(
            f"{work.log}: time stands still or goes backwards in {clock!r}."
        )
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


def _columns(work: _Work) -> tuple[list[Column], list[Column]]:
    """Columns that are told and seen, times and counters left out."""
    used = {column for column, _ in work.sources.values()}
    rest = [
        column
        for column in work.table.columns
        if column.name not in used and column.name.lower() not in matching.COUNTS
    ]
    model = work.model
    actuators = [model.actuator(a).name for a in range(model.nu)]
    joints = [model.joint(j).name for j in range(model.njnt)]
    told, seen = matching.roles(rest, actuators, joints)
    if not told and model.nu:  # noise has no steps: what stays to the bit is told
        held = [column for column in seen if _held(column.values)]
        if len(held) == model.nu:
            told, seen = held, [column for column in seen if column not in held]
            listed = ", ".join(column.name for column in told)
            work.unsure.append(f"commands: {listed}, for they change in steps")
    if not told:
        raise BnsError(
            f"No column of {work.log} is a command; it has "
            f"{', '.join(work.table.names)}. Call commands as the actuator, or "
            "JOINT_goal."
        )
    return told, seen


def _held(values: np.ndarray) -> bool:
    return bool(np.isfinite(values).all() and (np.diff(values) == 0).mean() > 0.8)


def _commands(work: _Work, told: list[Column], seen: list[Column]) -> None:
    """Which actuator each command goes to, in which unit; loops that are missing."""
    model = work.model
    told = [c for c in told if matching.quantity(c) != tables.EFFORT or not work.loop]
    owners = {
        _joint_of(model, a): model.actuator(a).name for a in reversed(range(model.nu))
    }
    names = [model.actuator(a).name for a in range(model.nu)]
    found, why = matching.match(told, names)
    if len(found) < len(told) and work.loop:  # a loop needs no actuator
        joints = [j for j in _joints(model) if j not in owners]
        more, reasons = matching.match([c for c in told if c.name not in found], joints)
        found, why = found | more, why | reasons
    by_joint, reasons = matching.match(told, [j for j in owners if j])
    for column in told:
        if column.name not in found and column.name in by_joint:
            found[column.name] = owners[by_joint[column.name]]
            why[column.name] = reasons[column.name]
    for column in told:
        if column.name in found:
            actuator = found[column.name]
            unit = _told_unit(work, column, actuator, seen)
            work.told.append((column, actuator, unit))
            reason = why[column.name]
            line = f"{column.name}: told to actuator {actuator!r} in {unit}, {reason}"
            (work.unsure if reason == "by order" else work.guessed).append(line)
        else:
            work.unsure.append(f"{column.name}: a command of no actuator, left out")
    if not work.told:
        raise BnsError(
            f"No command ({', '.join(c.name for c in told)}) is of an actuator of "
            f"{work.path} ({', '.join(names) or 'it has none: give --kp and --kd'})."
        )
    work.model = _compiled(work.path, _tolds(work))


def _joints(model: mujoco.MjModel) -> list[str]:
    return [
        model.joint(j).name
        for j in range(model.njnt)
        if rehearsal.hinged(model, j) and model.joint(j).name
    ]


def _joint_of(model: mujoco.MjModel, actuator: int) -> str:
    """The joint that an actuator drives; "" = none."""
    kinds = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    if int(model.actuator_trntype[actuator]) in map(int, kinds):
        return model.joint(int(model.actuator_trnid[actuator][0])).name
    return ""


def _told_unit(
    work: _Work, column: Column, actuator: str, seen: Sequence[Column]
) -> str:
    """The unit of a command: an angle or length for a position loop, else 1."""
    model, names = (
        work.model,
        [work.model.actuator(a).name for a in range(work.model.nu)],
    )
    number = names.index(actuator) if actuator in names else -1
    joint = _joint_of(model, number) if number >= 0 else actuator
    servo = work.loop or (number >= 0 and model.actuator_biasprm[number][1] < 0)
    if not servo:
        _no_loop(work, column, seen)
        return "1"
    if not joint or int(model.joint(joint).type[0]) != int(mujoco.mjtJoint.mjJNT_HINGE):
        units = {u: 1 / f for u, f in FACTORS["m"].items()}
    else:
        units = dict(rehearsal.ANGLE)
        units.pop("turn")
    said = matching.unit(column.name)
    if said in units:
        return said
    largest = _widest(model, number, joint)
    size = float(np.nanmax(np.abs(column.values)))
    return next((u for u, f in units.items() if size / f <= 1.05 * largest), "rad")


def _widest(model: mujoco.MjModel, number: int, joint: str) -> float:
    """The largest command that makes sense [rad or m]."""
    found = []
    if number >= 0 and model.actuator_ctrllimited[number]:
        found.append(float(np.abs(model.actuator_ctrlrange[number]).max()))
    if (
        joint
        and model.joint(joint).id >= 0
        and model.jnt_limited[model.joint(joint).id]
    ):
        found.append(float(np.abs(model.joint(joint).range).max()))
    return max(found, default=2 * np.pi)


def _no_loop(work: _Work, column: Column, seen: Sequence[Column]) -> None:
    """Stop where goals of joints are told to motors.

    Raises:
        BnsError: a position loop is missing.
    """
    name = matching.core(column.part or column.name)
    measured = [
        other
        for other in seen
        if matching.quantity(other) == tables.POSITION
        and matching.core(other.part or other.name) == name
    ]
    goal = column.quantity == tables.POSITION or set(matching.words(column.name)) & {
        "goal",
        "des",
        "desired",
        "target",
    }
    for other in measured[:1]:
        good = np.isfinite(other.values) & np.isfinite(column.values)
        pair = column.values[good], other.values[good]
        follows = len(pair[0]) > 5 and min(np.ptp(pair[0]), np.ptp(pair[1])) > 0
        goal = bool(goal) or (follows and np.corrcoef(*pair)[0, 1] > 0.95)
    if goal:
        raise BnsError(
            f"{column.name!r} is a goal of a joint, but its actuator in {work.path} is "
            "a motor: give the gains of the robot's position loop, --kp and --kd."
        )


def _tolds(work: _Work) -> list[Told]:
    """Command channels as a description has them, in SI units."""
    made = []
    for column, actuator, unit in work.told:
        values = column.values[np.isfinite(column.values)] * _factor(unit)
        allowed = (-np.inf, np.inf)
        names = [work.model.actuator(a).name for a in range(work.model.nu)]
        if actuator in names and not work.loop:
            number = names.index(actuator)
            if work.model.actuator_ctrllimited[number]:
                allowed = tuple(map(float, work.model.actuator_ctrlrange[number]))
        low, high = guesses.limits(values, allowed)
        channel = Channel(column.name, _si(unit))
        made.append(Told(channel, actuator, low, high, **work.loop))
    return made


def _factor(unit: str) -> float:
    return next((row[unit] for row in FACTORS.values() if unit in row), 1.0)


def _si(unit: str) -> str:
    return next((si for si, row in FACTORS.items() if unit in row), unit)


def _observed(work: _Work, seen: list[Column]) -> None:
    """Which part each measurement is of: by name, then by how the model moves."""
    effort = [c for c in seen if matching.quantity(c) == tables.EFFORT]
    seen = [c for c in seen if c not in effort]
    if effort:
        work.guessed.append(
            f"left out, for no torque is compared: {', '.join(c.name for c in effort)}"
        )
    model = work.model
    driven = [_joint_of(model, model.actuator(a).id) for _, a, _ in work.told]
    driven = [joint for joint in _joints(model) if joint in driven]
    found, why = {}, {}
    places = {
        kind: [getattr(model, kind)(n).name for n in range(count)]
        for kind, count in (("site", model.nsite), ("body", model.nbody))
    }
    speeds = [c for c in seen if matching.quantity(c) == tables.SPEED]
    joints = [c for c in seen if c not in speeds]
    named = matching.by_place(joints, places)
    for kind, group in (("joint", joints), ("speed", speeds)):
        rest = [c for c in group if c.name not in named or c.name in _joints(model)]
        for parts in (_joints(model), driven):
            left = [c for c in rest if c.name not in found]
            free = [p for p in parts if Part(kind, p) not in found.values()]
            hits, reasons = matching.match(left, free)
            found |= {name: Part(kind, part) for name, part in hits.items()}
            why |= reasons
    _rehearsed(work, seen, found, why, named)


def _rehearsed(work: _Work, seen, found, why, named) -> None:
    """Fill in what names do not tell by the nominal motion, units too."""
    rows = _first(work)
    moved = _moved(work, rows, found)
    for column in seen:
        values = column.values[rows]
        if column.name in found:
            options = [found[column.name]]
        elif column.name in named:
            kind, part, axis = named[column.name]
            options = [Part(kind, part, a) for a in (axis or "xyz")]
        elif matching.quantity(column) == tables.SPEED:
            options = []
        else:
            taken = set(found.values())
            options = [p for p in moved if p.quantity != "speed" and p not in taken]
        fits = {
            part: rehearsal.fit(
                values,
                moved[part],
                _units(work.model, part, column),
                joint=part.quantity == "joint",
            )
            for part in options
        }
        _chosen(work, column, fits, found, why, column.name in named)
    if not work.seen:
        raise BnsError(
            f"No column of {work.log} is a joint, site or body of {work.path}; call "
            f"them as its joints ({', '.join(_joints(work.model))})."
        )


def _units(model: mujoco.MjModel, part: Part, column: Column) -> dict[str, float]:
    known = dict(rehearsal.factors(model, part))
    said = matching.unit(column.name)
    return {said: known[said]} if said in known else known


def _chosen(work: _Work, column: Column, fits, found, why, named: bool) -> None:
    if not fits:
        work.unsure.append(f"{column.name}: of no part of the model, left out")
        return
    best = max(fits, key=lambda part: fits[part].score)
    fit = fits[best]
    if column.name not in found and fit.score < AGREES:
        work.unsure.append(f"{column.name}: moves as no part of the model, left out")
        return
    reason = why.get(column.name, "by its name" if named else "for it moves so")
    found[column.name] = best
    axis = f" along {best.axis}" if best.axis else ""
    line = f"{column.name}: {best.quantity} {best.name!r}{axis} in {fit.unit}, {reason}"
    work.seen.append((column, best, fit.unit))
    near = [
        part
        for part, other in fits.items()
        if part != best and other.score > fit.score - ALIKE
    ]
    if near and best.quantity != "joint":
        line += "; moves alike: " + ", ".join(
            f"{p.quantity} {p.name}" for p in near[:2]
        )
    sure = fit.score > AGREES and reason not in ("by order", "for it moves so")
    if fit.correlation < -AGREES:
        line += "; it moves against the model: is its sign another?"
        sure = False
    elif fit.score <= AGREES:
        line += "; it hardly moves as the model does"
    (work.guessed if sure else work.unsure).append(line)


def _first(work: _Work) -> np.ndarray:
    """Rows of the trial whose commands move most, from its start on."""
    told = [c.values for c, _, _ in work.told]
    rows = max(work.rows, key=lambda r: sum(np.ptp(v[r]) for v in told))
    return rows[work.times[rows] <= work.times[rows[0]] + REHEARSED]


def _moved(work: _Work, rows: np.ndarray, found) -> dict[Part, np.ndarray]:
    model, data = work.model, mujoco.MjData(work.model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    columns = {column.name: column.values for column in work.table.columns}
    for name, part in found.items():
        if part.quantity == "joint":
            values = columns[name][rows]
            first = values[np.isfinite(values)][:1]
            span = np.abs(values[np.isfinite(values)]).max(initial=0.0)
            if len(first) and span <= 2 * np.pi:
                data.joint(part.name).qpos[0] = first[0]
    told = np.stack(
        [c.values[rows] * _factor(unit) for c, _, unit in work.told], axis=1
    )
    actuators = [model.actuator(actuator).id for _, actuator, _ in work.told]
    times = work.times[rows] - work.times[rows[0]]
    return rehearsal.motions(model, data, actuators, times, np.nan_to_num(told))


def _begin(work: _Work) -> None:
    """How trials begin: at rest in a pose, or where they were; cut or not."""
    told = np.stack([c.values for c, _, _ in work.told], axis=1)
    longest = max(work.rows, key=len)
    span = float(np.ptp(work.times[longest]))
    first, tolerance = {}, {}
    for column, part, unit in work.seen:
        if part.quantity == "joint":
            pieces = [column.values[rows] * _factor(unit) for rows in work.rows]
            heads = [p[np.isfinite(p)][:1] for p in pieces]
            first[part.name] = float(np.median(np.concatenate(heads)))
            wide = guesses.NEAR * float(
                np.nanmax(column.values) - np.nanmin(column.values)
            )
            tolerance[part.name] = max(
                guesses.SIGMAS * guesses.noise(pieces), wide * _factor(unit)
            )
    pose, settle = guesses.rests(work.model, first, tolerance)
    if span > guesses.LONG and guesses.curved(told[longest]):
        work.start = {"recorded": True, "cut": guesses.CUT}
        work.start |= {"keyframe": pose} if pose else {}
        work.guessed.append(
            f"start: one long recording, cut into pieces of {guesses.CUT:g} s that "
            "begin with the positions and speeds of the data"
        )
    elif pose is None:
        work.start = {"recorded": True}
        work.unsure.append(
            "start: trials begin in no pose of the model at rest, so each begins where "
            "its joints were recorded; give a keyframe for the rest"
        )
    else:
        work.start = {"keyframe": pose} if pose else {}
        work.start |= {"settle": settle} if settle else {}
        what = f"keyframe {pose!r}" if pose else "the model's own pose"
        work.guessed.append(f"start: at rest in {what}, settling for {settle:g} s")


def _toml(work: _Work, out: Path) -> str:
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
    if 2 * step > WINDOW:
        lines.append(f"window = {2 * step:.4g}")
    for item in _tolds(work):
        lines += _table(
            f"commands.{_text(item.channel.name)}",
            {
                "actuator": item.actuator,
                "unit": item.channel.unit,
                "low": item.low,
                "high": item.high,
                **{k: v for k, v in work.loop.items() if np.isfinite(v)},
            },
        )
    for column, part, unit in work.seen:
        pieces = [column.values[rows] * _factor(unit) for rows in work.rows]
        axis = {"axis": part.axis} if part.axis else {}
        noise = float(f"{guesses.noise(pieces):.3g}")
        given = {part.quantity: part.name, **axis, "unit": _si(unit), "noise": noise}
        lines += _table(f"observed.{_text(column.name)}", given)
    if work.start:
        lines += _table("start", work.start)
    return "\n".join([*lines, *_effects(work), *_log(work)]) + "\n"


def _effects(work: _Work) -> list[str]:
    """[effects] where the model has bodies that no actuator can move."""
    from bns.gap.candidates import mjcf
    from bns.gap.models.mjcf.effects import OWNERS

    model = work.model
    root = {}
    for joint in _joints(model):
        body = int(model.joint(joint).bodyid[0])
        root[joint] = int(model.body_rootid[body])
    drives = {_joint_of(model, model.actuator(a).id) for _, a, _ in work.told}
    moved = {root[joint] for joint in drives if joint in root}
    if not moved or set(root.values()) <= moved:
        return []
    bodies = {int(model.joint(j).bodyid[0]) for j in root if root[j] in moved}
    parts = {
        "joint": [j for j in root if root[j] in moved],
        "body": [model.body(b).name for b in sorted(bodies) if model.body(b).name],
        "actuator": [actuator for _, actuator, _ in work.told],
    }
    seen = [column.name for column, _, _ in work.seen]
    given = {
        name: parts.get(
            OWNERS.get(name, ""), seen if name == "sensor_gain" else ["all"]
        )
        for name in mjcf.USUAL
    }
    work.guessed.append("effects: the usual ones, on parts that the commands can move")
    return _table("effects", given)


def _log(work: _Work) -> list[str]:
    """[log]: columns that are called otherwise, or are not in SI units."""
    lines = {}
    units = {c.name: unit for c, _, unit in (*work.told, *work.seen)}
    for name, (column, unit) in work.sources.items():
        if column != name or unit not in ("", "s"):
            lines[name] = (column, unit)
    for name, unit in units.items():
        if _factor(unit) != 1.0:
            lines[name] = (name, unit)
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
