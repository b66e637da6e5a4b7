"""Which column of a log is told to which actuator, or seen of which part of a model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from bns.errors import BnsError, FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column, Table
from bns.gap.models.mjcf import guesses, matching, prepared, rehearsal
from bns.gap.models.mjcf.config import OwnConfig, Told
from bns.gap.models.mjcf.rehearsal import Fit, Part
from bns.worlds.data.importing import FACTORS
from bns.worlds.trial import Channel

REHEARSED = 5.0  # [s] of the first trial that the nominal model moves along
AGREES = 0.5  # score from which on a column moves as the model says
GOAL = {"goal", "des", "desired", "target"}
"""words for a position that a joint is told"""
ALIKE = 0.1  # two parts whose scores are nearer cannot be told apart


@dataclass(eq=False)
class Work:
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


def compiled(path: Path, told: Sequence[Told]) -> mujoco.MjModel:
    """The robot's model with the loops of its commands, compiled.

    Args:
        path: MJCF file.
        told: commands, with their actuators and gains.

    Raises:
        FormatError: there is no such file, or MuJoCo cannot compile it.
    """
    if not path.is_file():
        raise FormatError(
            f"There is no model file {path}: give an MJCF file; a robot of `bns "
            "robots` needs no description."
        )
    try:
        return prepared.spec(OwnConfig(path.stem, path, tuple(told), ())).compile()
    except ValueError as error:
        first = str(error).strip().splitlines()[0]
        raise FormatError(f"{path}: {first}") from None


def commands(work: Work, told: list[Column], seen: list[Column]) -> None:
    """Which actuator each command goes to, in which unit; loops that are missing.

    Args:
        work: the description so far; gets commands, guesses and the model with loops.
        told: columns of commands.
        seen: columns of readings.

    Raises:
        BnsError: no column is a command of an actuator of the model.
    """
    model = work.model
    told = [c for c in told if matching.quantity(c) != tables.EFFORT or not work.loop]
    owners = {
        joint_of(model, a): model.actuator(a).name for a in reversed(range(model.nu))
    }
    names = [model.actuator(a).name for a in range(model.nu)]
    found, why = matching.match(told, names)
    if len(found) < len(told) and work.loop:  # a loop needs no actuator
        free = [j for j in joints(model) if j not in owners]
        more, reasons = matching.match([c for c in told if c.name not in found], free)
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
    work.model = compiled(work.path, tolds(work))


def joints(model: mujoco.MjModel) -> list[str]:
    """Names of a model's hinges and slides; those without a name are left out."""
    return [
        model.joint(j).name
        for j in range(model.njnt)
        if rehearsal.hinged(model, j) and model.joint(j).name
    ]


def joint_of(model: mujoco.MjModel, actuator: int) -> str:
    """The joint that an actuator drives; "" = none."""
    kinds = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    if int(model.actuator_trntype[actuator]) in map(int, kinds):
        return model.joint(int(model.actuator_trnid[actuator][0])).name
    return ""


def _told_unit(
    work: Work, column: Column, actuator: str, seen: Sequence[Column]
) -> str:
    """The unit of a command: an angle or length for a position loop, else 1."""
    model, names = (
        work.model,
        [work.model.actuator(a).name for a in range(work.model.nu)],
    )
    number = names.index(actuator) if actuator in names else -1
    joint = joint_of(model, number) if number >= 0 else actuator
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


def _no_loop(work: Work, column: Column, seen: Sequence[Column]) -> None:
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
    said = set(matching.words(column.name))
    goal = column.quantity == tables.POSITION or bool(said & GOAL)
    for other in measured[:1]:
        good = np.isfinite(other.values) & np.isfinite(column.values)
        pair = column.values[good], other.values[good]
        follows = len(pair[0]) > 5 and min(np.ptp(pair[0]), np.ptp(pair[1])) > 0
        goal = goal or (follows and np.corrcoef(*pair)[0, 1] > 0.95)
    if goal:
        raise BnsError(
            f"{column.name!r} is a goal of a joint, but its actuator in {work.path} is "
            "a motor: give the gains of the robot's position loop, --kp and --kd."
        )


def tolds(work: Work) -> list[Told]:
    """Command channels as a description has them, in SI units."""
    made = []
    for column, actuator, unit in work.told:
        values = column.values[np.isfinite(column.values)] * factor(unit)
        allowed = (-np.inf, np.inf)
        names = [work.model.actuator(a).name for a in range(work.model.nu)]
        if actuator in names and not work.loop:
            number = names.index(actuator)
            if work.model.actuator_ctrllimited[number]:
                edges = work.model.actuator_ctrlrange[number]
                allowed = float(edges[0]), float(edges[1])
        low, high = guesses.limits(values, allowed)
        channel = Channel(column.name, si_unit(unit))
        made.append(Told(channel, actuator, low, high, **work.loop))
    return made


def factor(unit: str) -> float:
    """What a value in a unit is multiplied by for SI; 1 for an unknown unit."""
    return next((row[unit] for row in FACTORS.values() if unit in row), 1.0)


def si_unit(unit: str) -> str:
    """The SI unit that goes with a unit; an unknown unit as it is."""
    return next((si for si, row in FACTORS.items() if unit in row), unit)


def observed(work: Work, seen: list[Column]) -> None:
    """Which part each measurement is of: by name, then by how the model moves."""
    effort = [c for c in seen if matching.quantity(c) == tables.EFFORT]
    seen = [c for c in seen if c not in effort]
    if effort:
        work.guessed.append(
            f"left out, for no torque is compared: {', '.join(c.name for c in effort)}"
        )
    model = work.model
    driven = [joint_of(model, model.actuator(a).id) for _, a, _ in work.told]
    driven = [joint for joint in joints(model) if joint in driven]
    found: dict[str, Part] = {}
    why: dict[str, str] = {}
    places = {
        kind: [getattr(model, kind)(n).name for n in range(count)]
        for kind, count in (("site", model.nsite), ("body", model.nbody))
    }
    speeds = [c for c in seen if matching.quantity(c) == tables.SPEED]
    others = [c for c in seen if c not in speeds]
    named = matching.by_place(others, places)
    for kind, group in (("joint", others), ("speed", speeds)):
        rest = [c for c in group if c.name not in named or c.name in joints(model)]
        for parts in (joints(model), driven):
            left = [c for c in rest if c.name not in found]
            free = [p for p in parts if Part(kind, p) not in found.values()]
            hits, reasons = matching.match(left, free)
            found |= {name: Part(kind, part) for name, part in hits.items()}
            why |= reasons
    _rehearsed(work, seen, found, why, named)


def _rehearsed(
    work: Work,
    seen: Sequence[Column],
    found: dict[str, Part],
    why: Mapping[str, str],
    named: Mapping[str, tuple[str, str, str]],
) -> None:
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
            f"them as its joints ({', '.join(joints(work.model))})."
        )


def _units(model: mujoco.MjModel, part: Part, column: Column) -> dict[str, float]:
    known = dict(rehearsal.factors(model, part))
    said = matching.unit(column.name)
    return {said: known[said]} if said in known else known


def _chosen(
    work: Work,
    column: Column,
    fits: Mapping[Part, Fit],
    found: dict[str, Part],
    why: Mapping[str, str],
    named: bool,
) -> None:
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


def _first(work: Work) -> np.ndarray:
    """Rows of the trial whose commands move most, from its start on."""
    told = [c.values for c, _, _ in work.told]
    rows = max(work.rows, key=lambda r: sum(np.ptp(v[r]) for v in told))
    return rows[work.times[rows] <= work.times[rows[0]] + REHEARSED]


def _moved(
    work: Work, rows: np.ndarray, found: Mapping[str, Part]
) -> dict[Part, np.ndarray]:
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
    return replayed(work, rows, data)


def replayed(
    work: Work, rows: np.ndarray, data: mujoco.MjData
) -> dict[Part, np.ndarray]:
    """What the model does of itself under the commands of some samples.

    Args:
        work: what is known of the log.
        rows: numbers of the samples, ``(T,)``.
        data: the model's state at the first of them; is changed.

    Returns:
        positions of all joints, named sites and bodies, each ``(T,)``.
    """
    told = np.stack([c.values[rows] * factor(unit) for c, _, unit in work.told], axis=1)
    actuators = [work.model.actuator(name).id for _, name, _ in work.told]
    times = work.times[rows] - work.times[rows[0]]
    return rehearsal.motions(work.model, data, actuators, times, np.nan_to_num(told))
