"""Which column of a log is told to which actuator of a model."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from scipy import optimize

from bns.errors import BnsError, FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column, Table
from bns.gap.models.mjcf import guesses, matching, prepared, rehearsal, ties
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.described import Told
from bns.gap.models.mjcf.rehearsal import Part
from bns.worlds.data.units import factor, per_si, si_unit
from bns.worlds.trial import Channel

FOLLOWS = 0.7  # correlation with a command of a joint that follows it
FOLLOWED = "for its joint follows it, which the order of names does not say"
DEGREES = 20.0  # times a joint's range: limits of control in degrees (57), not radians
GOAL = {"goal", "des", "desired", "target"}
"""words for a position that a joint is told"""
AS_FAR = np.log(1.5)  # ratio of two columns of an angle that are of one motion
TURNED = (np.rad2deg(1.0), np.deg2rad(1.0))  # the same in degrees and radians


@dataclass(eq=False)
class Work:
    """What is known so far; grows step by step."""

    path: Path
    log: str
    table: Table
    loop: dict[str, tuple[float, ...]]
    model: mujoco.MjModel
    sources: dict[str, tuple[str, str]] = field(default_factory=dict)
    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rows: list[np.ndarray] = field(default_factory=list)
    told: list[tuple[Column, str, str]] = field(default_factory=list)
    seen: list[tuple[Column, Part, str]] = field(default_factory=list)
    guessed: list[str] = field(default_factory=list)
    unsure: list[str] = field(default_factory=list)
    start: dict[str, object] = field(default_factory=dict)
    held: tuple[str, ...] = ()

    def channel(self, column: Column, unit: str) -> str:
        """What the description calls a column: by its name, without a unit there that
        is none of SI, since channels are in these, or by the joint of a topic; unless
        another is called so."""
        if column.name.startswith("/") and ":" in column.name:
            return self._joint(column)
        plain = matching.unitless(column.name)
        others = {n for n in self.table.names if n != column.name}
        taken = {plain} & (others | set(map(matching.unitless, others)))
        return column.name if taken or factor(unit) == 1.0 else plain

    def _joint(self, column: Column) -> str:
        """The shorter of `_shorter` that no other command has, nor, of what was seen,
        anything else that was seen, nor a command; else the name."""
        alike = [other.name for other, _, _ in self.told]
        taken: set[str] = set()
        if column.name not in alike:
            alike = [other.name for other, _, _ in self.seen]
            taken = {self.channel(other, unit) for other, _, unit in self.told}
        for name in _shorter(column.name):
            others = [other for other in alike if other != column.name]
            mine = all(name not in _shorter(other) for other in others)
            if mine and name not in taken and not name.isdigit():
                return name
        return column.name


def _shorter(name: str) -> tuple[str, str]:
    """ "knee" and "velocity.knee" of "/topic:velocity.knee"."""
    field = name.partition(":")[2]
    return field.partition(".")[2], field


def compiled(
    path: Path, told: Sequence[Told], held: tuple[str, ...] = ()
) -> mujoco.MjModel:
    """The robot's model with the loops of its commands, compiled.

    Args:
        path: MJCF file.
        told: commands, with their actuators and gains.
        held: bodies that a stand holds.

    Raises:
        FormatError: there is no such file, or MuJoCo cannot compile it.
    """
    if not path.is_file():
        raise FormatError(
            f"There is no model file {path}: give an MJCF file; a robot of `bns "
            "robots` needs no description."
        )
    if path.suffix == ".xacro":
        urdf = path.with_suffix(".urdf")
        raise FormatError(f"{path}: run `xacro {path} > {urdf}`, then give {urdf}.")
    try:
        config = OwnConfig(path.stem, path, tuple(told), (), held)
        return prepared.spec(config).compile()
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
    _followed(model, told, seen, found, why)
    for column in told:
        if column.name in found:
            actuator = found[column.name]
            unit = _told_unit(work, column, actuator, seen)
            work.told.append((column, actuator, unit))
            reason = why[column.name]
            line = f"{column.name}: told to actuator {actuator!r} in {unit}, {reason}"
            unsure = reason in (*matching.UNSURE, FOLLOWED)
            (work.unsure if unsure else work.guessed).append(line)
        else:
            work.unsure.append(f"{column.name}: a command of no actuator, left out")
    if not work.told:
        raise BnsError(
            f"No command ({', '.join(c.name for c in told)}) is of an actuator of "
            f"{work.path} ({', '.join(names) or 'it has none: give --kp and --kd'})."
        )
    _each(work)
    told_to = {actuator for _, actuator, _ in work.told}
    if not work.loop:
        work.unsure.extend(
            f"actuator {name!r}: told by no column, so taken to be told 0"
            for name in names
            if name not in told_to
        )
    work.model = compiled(work.path, tolds(work))


def _followed(
    model: mujoco.MjModel,
    told: Sequence[Column],
    seen: Sequence[Column],
    found: dict[str, str],
    why: dict[str, str],
) -> None:
    """Commands that order alone gave to position loops, given to those whose joints
    follow them: a controller may list its joints in an order of its own.

    Args:
        model: of the robot.
        told: columns of commands.
        seen: columns of readings.
        found: actuator by column; changed where joints follow other columns better.
        why: reason by column; the same.
    """
    places = [c for c in seen if matching.quantity(c) == tables.POSITION]
    joint, _ = matching.match(places, joints(model))
    reading = {joint[c.name]: c.values for c in places if c.name in joint}
    loops = {
        model.actuator(a).name: joint_of(model, a)
        for a in range(model.nu)
        if model.actuator_biasprm[a][1] < 0 and joint_of(model, a) in reading
    }
    columns = [c for c in told if why.get(c.name) == matching.BY_ORDER]
    columns = [c for c in columns if found[c.name] in loops]
    if len(columns) < 2:
        return
    actuators = [found[column.name] for column in columns]
    alike = np.array(
        [
            [matching.alike(c.values, reading[loops[a]]) for a in actuators]
            for c in columns
        ]
    )
    rows, best = optimize.linear_sum_assignment(alike, maximize=True)
    if alike[rows, best].min() > FOLLOWS > np.diagonal(alike).min():
        for column, number in zip(columns, best, strict=True):
            found[column.name] = actuators[number]
            why[column.name] = FOLLOWED


def joints(model: mujoco.MjModel) -> list[str]:
    """Names of a model's hinges and slides; those without a name are left out."""
    return [
        model.joint(j).name
        for j in range(model.njnt)
        if prepared.hinged(model, j) and model.joint(j).name
    ]


def joint_of(model: mujoco.MjModel, actuator: int) -> str:
    """The joint that an actuator drives; "" = none."""
    joint = prepared.driven(model, actuator)
    return model.joint(joint).name if joint >= 0 else ""


def _told_unit(
    work: Work, column: Column, actuator: str, seen: Sequence[Column]
) -> str:
    """The unit of a command: an angle or length for a position loop, a rate for a loop
    of speed, else 1."""
    model, names = (
        work.model,
        [work.model.actuator(a).name for a in range(work.model.nu)],
    )
    number = names.index(actuator) if actuator in names else -1
    joint = joint_of(model, number) if number >= 0 else actuator
    bias = model.actuator_biasprm[number] if number >= 0 else np.zeros(3)
    position = bool(work.loop) or bias[1] < 0
    if not position and bias[2] >= 0:
        _no_loop(work, column, seen)
        return "1"
    moved = [joint] if joint else _wound(model, number)
    turning = moved and all(rehearsal.turns(model, name) for name in moved)
    known = per_si(("rad" if turning else "m") + "/s" * (not position))
    for unusual in ("turn", "khepera-speed"):
        known.pop(unusual, None)
    said = matching.unit(column.name)
    if said in known:
        return said
    largest = _widest(model, number, joint) if position else _fastest(model, number)
    size = float(np.nanmax(np.abs(column.values)))
    fits = (u for u, f in known.items() if size / f <= 1.05 * largest)
    return next(fits, next(iter(known)))


def _fastest(model: mujoco.MjModel, number: int) -> float:
    """The largest speed that an actuator may be told."""
    limited = bool(model.actuator_ctrllimited[number])
    return float(np.abs(model.actuator_ctrlrange[number]).max()) if limited else np.inf


def _wound(model: mujoco.MjModel, actuator: int) -> list[str]:
    """Joints of the fixed tendon that an actuator pulls; none for other actuators."""
    if int(model.actuator_trntype[actuator]) != int(mujoco.mjtTrn.mjTRN_TENDON):
        return []
    return ties.wound(model, int(model.actuator_trnid[actuator][0]))


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
    if len(found) > 1 and found[0] > DEGREES * found[1]:
        return found[1]  # limits of control that were written in degrees
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
        goal = goal or _goes_with(column.values, other.values)
    if goal:
        raise BnsError(
            f"{column.name!r} is a goal of a joint, but its actuator in {work.path} is "
            "a motor: give the gains of the robot's position loop, --kp and --kd."
        )


def _goes_with(told: np.ndarray, seen: np.ndarray) -> bool:
    """Whether an angle goes as what is told, as far: what holds a joint against gravity
    goes as its angle, too."""
    if matching.alike(told, seen) <= 0.95:
        return False
    far = np.nanstd(seen) / np.nanstd(told)
    return any(abs(np.log(far / unit)) < AS_FAR for unit in (1.0, *TURNED))


def tolds(work: Work) -> list[Told]:
    """Command channels as a description has them, in SI units."""
    made = []
    for row, (column, actuator, unit) in enumerate(work.told):
        values = column.values[np.isfinite(column.values)] * factor(unit)
        allowed = (-np.inf, np.inf)
        names = [work.model.actuator(a).name for a in range(work.model.nu)]
        if actuator in names and not work.loop:
            number = names.index(actuator)
            if work.model.actuator_ctrllimited[number]:
                edges = work.model.actuator_ctrlrange[number]
                allowed = float(edges[0]), float(edges[1])
        low, high = guesses.limits(values, allowed)
        channel = Channel(work.channel(column, unit), si_unit(unit))
        loop = {key: given[row % len(given)] for key, given in work.loop.items()}
        made.append(Told(channel, actuator, low, high, **loop))
    return made


def _each(work: Work) -> None:
    """Stop where gains are neither one for all commands nor one for each, or are none.

    Raises:
        BnsError: so it is.
    """
    for key, given in work.loop.items():
        if not min(given) >= 0 or (key == "kp" and not min(given) > 0):
            raise BnsError(
                f"--{key} {min(given):g} is no gain: give a positive --kp, and --kd "
                "and --torque not below 0."
            )
        if len(given) not in (1, len(work.told)):
            raise BnsError(
                f"--{key} has {len(given)} values for {len(work.told)} commands: give "
                "one for all, or one for each of "
                f"{', '.join(column.name for column, _, _ in work.told)}."
            )
