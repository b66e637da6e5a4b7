"""What a column of a log is, by its name: told or seen, which part, which unit."""

import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from bns.gap.importers import tables
from bns.gap.importers.tables import Column
from bns.gap.models.mjcf.described import AXES
from bns.gap.models.mjcf.rehearsal import Part
from bns.worlds.data.units import FACTORS, RATES


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


TOLD = _set(
    "goal cmd command commanded commands des desired target ref reference "
    "setpoint sp action ctrl control told u"
)
SEEN = _set(
    "meas measured actual state obs observed observation fb feedback enc encoder real"
)
SPEED = _set("vel velocity velocities speed dq qd qvel omega dot")
TORQUE = _set("torque torques tau effort force")
EFFORT = TORQUE | _set("current load voltage temp")
POSITION = _set("pos position positions angle q qpos joint jnt dof")
DRIVE = _set("motor servo act actuator drive")
UNITS = {
    "rad": "rad",
    "radian": "rad",
    "radians": "rad",
    "deg": "deg",
    "degree": "deg",
    "degrees": "deg",
    "m": "m",
    "cm": "cm",
    "mm": "mm",
    "s": "s",
    "sec": "s",
    "seconds": "s",
    "ms": "ms",
    "us": "us",
    "ns": "ns",
    "dps": "deg/s",
    "rpm": "rpm",
}
BY_WORD, BY_ORDER = "by a word of its name", "by order"
UNSURE = (BY_WORD, BY_ORDER)
TIMES = _set("time t stamp timestamp timestamps secs clock elapsed")
TRIALS = _set("trial run episode episode_index rep repetition")
SENT = _set("command_time sent cmd_time sent_time t_sent t_cmd time_sent")
COUNTS = _set("frame index frame_index seq sequence task_index step row")
TURNED = {
    "roll": "roll",
    "phi": "roll",
    "pitch": "pitch",
    "yaw": "yaw",
    "heading": "yaw",
    "theta": "yaw",
    "psi": "yaw",
}
"""words for how a body is turned, as `described.TURNS` calls it"""
WHOLE = POSITION | _set("pose place robot base body mocap odom tracker camera")
"""words for a free robot as a whole"""
ONLY = "for the model has one alone"
LENGTH, TENDON = _set("length len"), _set("tendon cable rope string wire")
QUATERNION = _set("qw qx qy qz quat quaternion")


def words(name: str) -> list[str]:
    """The words and numbers in a name, in lower case; "d_elbow" is "dq elbow"."""
    split = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    found = re.findall(r"[a-z]+|\d+", split.lower())
    return ["dq", *found[1:]] if found[:1] == ["d"] and len(found) > 1 else found


def unit(name: str) -> str:
    """The unit at the end of a name, "elbow_vel_rad_s", or before words for that it is
    told or seen, "elbow_deg_goal"; "" = none there."""
    return _ending(words(name))[1] or _ending(_unsaid(name))[1]


def _ending(said: Sequence[str]) -> tuple[int, str]:
    """How many words of a name are its unit, and the unit."""
    per = 2 if said[-2:] == ["per", "s"] else 1
    if len(said) > per + 1 and said[-1] == "s":
        rate = f"{UNITS.get(said[-1 - per])}/s"
        if rate in RATES:
            return per + 1, rate
    return (1, UNITS[said[-1]]) if len(said) > 1 and said[-1] in UNITS else (0, "")


def unitless(name: str) -> str:
    """A name without its unit, see `unit`: "elbow_deg" is "elbow"; as it is, where the
    unit is not parted from the rest."""
    count = _ending(words(name))[0]
    for _ in range(count):
        name = re.sub(r"[\W_]+[A-Za-z]+[\W_]*$", "", name) or name
    if not count and (inside := _ending(_unsaid(name))[0]):
        for word in _unsaid(name)[-inside:]:
            name = re.sub(rf"[\W_]+{word}(?=[\W_])", "", name, flags=re.IGNORECASE)
    return name


def core(name: str) -> str:
    """What is left of a name without words for what and in which unit it is."""
    return "".join(_own(name))


def _own(name: str) -> list[str]:
    """The words that `core` joins."""
    said = words(name)
    said = said if _ending(said)[0] else _unsaid(name)
    said = said[: len(said) - _ending(said)[0]]
    dropped = TOLD | SEEN | SPEED | EFFORT | POSITION | DRIVE
    return [word for word in said if word not in dropped]


def _bare(name: str) -> str:
    """What is left of a name without words for that it is told or seen."""
    return "".join(_unsaid(name))


def _unsaid(name: str) -> list[str]:
    """The words that `_bare` joins."""
    return [word for word in words(name) if word not in TOLD | SEEN]


def quantity(column: Column) -> str:
    """Position, speed or effort, as `bns.gap.importers.tables` calls them."""
    if column.quantity:
        return column.quantity
    said = set(words(column.name))
    if said & EFFORT:
        return tables.EFFORT
    rate = unit(column.name) in RATES
    return tables.SPEED if said & SPEED or rate else tables.POSITION


def clock(names: Sequence[str]) -> str:
    """The column of times; "" if none is called so."""
    if tables.TIME in names:
        return tables.TIME
    for name in names:
        said = words(name)
        if name.lower() not in SENT and said and said[0] in TIMES:
            return name
    return ""


def one_of(names: Sequence[str], known: frozenset[str]) -> str:
    """The first name that is one of the known ones; "" if none is."""
    return next((name for name in names if name.lower() in known), "")


def roles(
    columns: Sequence[Column], actuators: Sequence[str], joints: Sequence[str]
) -> tuple[list[Column], list[Column]]:
    """Columns that are told, and those that are seen.

    By the format; by a joint's own name; by words in the name; an actuator's own name,
    where a joint has another one or is seen elsewhere, and no goal is called so.

    Args:
        columns: of the log.
        actuators: names in the model.
        joints: names in the model.
    """
    told: list[Column] = []
    seen: list[Column] = []
    own, joint = set(actuators) - set(joints), set(joints) - set(actuators)
    goals = {core(c.name) for c in columns if set(words(c.name)) & TOLD}
    for column in columns:
        said = set(words(column.name))
        measured = bool(said & (SEEN | SPEED | EFFORT))
        if column.role:
            (told if column.role == tables.TOLD else seen).append(column)
        elif column.name in joint or measured:
            seen.append(column)
        elif said & TOLD or (column.name in own and core(column.name) not in goals):
            told.append(column)
        else:
            seen.append(column)
    if not told:  # each joint twice: by its name, and as measured
        again = {core(c.name) for c in seen if set(words(c.name)) & SEEN}
        told = [c for c in seen if c.name in actuators and core(c.name) in again]
        seen = [column for column in seen if column not in told]
    return told, seen


def second_choice(
    columns: Sequence[Column], actuators: Sequence[str]
) -> tuple[list[Column], str]:
    """Columns that are commands where no other is, and why.

    Torques and speeds that are told: beside goals a controller made them. Then as many
    as there are actuators, or so called: efforts, what is called after a drive, and
    what changes in steps to the bit, as noise does not.

    Args:
        columns: of the log, none of which `roles` finds to be told.
        actuators: names in the model.

    Returns:
        the columns, and why they may be commands; "" = their names say so.
    """
    free = [(c, set(words(c.name))) for c in columns if not c.role]
    said_so = [(c, said) for c, said in free if said & TOLD and not said & SEEN]
    for kind in (EFFORT, SPEED):
        if told := [c for c, said in said_so if said & kind]:
            return told, ""
    cores = {core(name) for name in actuators} - {""}
    for made, why in (
        ([c for c, said in free if said & TORQUE], "no other column is one"),
        ([c for c, said in free if said & DRIVE], "no other column is one"),
        ([c for c, _ in free if _held(c.values)], "they change in steps"),
    ):
        called = all(core(column.name) in cores for column in made)
        if made and (called or len(made) == len(actuators)):
            return made, why
    return [], ""


def alike(one: np.ndarray, other: np.ndarray) -> float:
    """Correlation of columns ``(T,)`` where both have numbers; 0 if one is still."""
    good = np.isfinite(one) & np.isfinite(other)
    pair = one[good], other[good]
    if good.sum() <= 5 or not min(np.ptp(pair[0]), np.ptp(pair[1])) > 0:
        return 0.0
    return float(np.corrcoef(*pair)[0, 1])


def _held(values: np.ndarray) -> bool:
    steps = np.diff(values)
    return bool(np.isfinite(values).all() and 0.8 < (steps == 0).mean() < 1.0)


def match(
    columns: Sequence[Column], parts: Sequence[str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Which part each column is of, and how that was found.

    By the same name; by the same name without words for what it is; by one name that
    ends with the other; by a word that no other column and part share; by order, if as
    many columns as parts are left.

    Args:
        columns: of one quantity.
        parts: names of joints or actuators, in the order of the model.

    Returns:
        part by column, and the reason by column; columns without one are left out.
    """
    found: dict[str, str] = {}
    why: dict[str, str] = {}
    rules = (
        ("by its name", lambda c, p: (c.part or c.name) == p),
        ("by its name", lambda c, p: _alike(_bare(c.part or c.name), _bare(p))),
        ("by its name", lambda c, p: _alike(core(c.part or c.name), core(p))),
        ("by the end of its name", lambda c, p: _ends(core(c.part or c.name), core(p))),
        (BY_WORD, lambda c, p: bool(_telling(c.part or c.name) & _telling(p))),
    )
    for reason, fits in rules:
        _unique(columns, parts, fits, found, why, reason)
    left = [column for column in columns if column.name not in found]
    free = [part for part in parts if part not in found.values()]
    if left and len(left) == len(free):
        for column, part in zip(left, free, strict=True):
            found[column.name], why[column.name] = part, BY_ORDER
    return found, why


def _unique(
    columns: Sequence[Column],
    parts: Sequence[str],
    fits: Callable[[Column, str], bool],
    found: dict[str, str],
    why: dict[str, str],
    reason: str,
) -> None:
    for column in columns:
        free = [part for part in parts if part not in found.values()]
        hits = [part for part in free if fits(column, part)]
        if column.name in found or len(hits) != 1:
            continue
        others = [c for c in columns if c.name not in found and fits(c, hits[0])]
        if len(others) == 1:
            found[column.name], why[column.name] = hits[0], reason


def _telling(name: str) -> frozenset[str]:
    """Words of a name that may tell one part from others: "left", not "pos" or "mm"."""
    return frozenset(word for word in _own(name) if len(word) > 2)


def _alike(one: str, other: str) -> bool:
    return bool(one) and one == other


def _ends(one: str, other: str) -> bool:
    short, long = sorted((one, other), key=len)
    return len(short) > 2 and not short.isdigit() and long.endswith(short)


def oriented(columns: Sequence[Column]) -> list[Column]:
    """Columns of a quaternion: how something is turned in space."""
    return [c for c in columns if set(words(c.name)[-2:]) & QUATERNION]


def _one(stem: str, parts: Sequence[str]) -> str:
    """The part that is called as a stem, or alone so without words for what it is."""
    alike = [part for part in parts if part and core(stem) == core(part)]
    return stem if stem in parts else alike[0] if len(alike) == 1 else ""


def by_place(
    columns: Sequence[Column], table: Mapping[str, Sequence[str]], free: str = ""
) -> dict[str, tuple[Part, ...]]:
    """Columns that are called as a site, body or tendon, with an axis or not.

    Args:
        columns: that are no joints.
        table: names of parts by kind, "site", "body" and "tendon".
        free: the one body on a free joint, that a column "x" or "heading" is of; "" =
            there is none, or several.

    Returns:
        by column what it may be of: one part, unless no axis is said.
    """
    found: dict[str, tuple[Part, ...]] = {}
    for column in columns:
        angle = unit(column.name) in FACTORS["rad"]
        pieces = column.name.split("_")
        size = _ending([piece.lower() for piece in pieces])[0]
        plain = "_".join(pieces[: len(pieces) - size])
        stem, _, last = plain.rpartition("_")
        axis = last if last in AXES and not angle else TURNED.get(last.lower(), "")
        for kind, parts in table.items():
            called = next((name for name in (column.name, plain) if name in parts), "")
            if kind == "tendon":
                called = called or _wound(column, parts)
                made: tuple[Part, ...] = (Part(kind, called),)
            elif called:
                made = () if angle else tuple(Part(kind, called, a) for a in AXES)
            else:
                called = _one(stem, parts) if axis else ""
                made = (Part(kind, called, axis),)
            if called and made:
                found.setdefault(column.name, made)
        if axis and free and {*words(stem)} <= WHOLE:
            found.setdefault(column.name, (Part("body", free, axis),))
    return found


def _wound(column: Column, tendons: Sequence[str]) -> str:
    """The tendon whose length a column is by its name: called so, or the only one."""
    said = set(words(column.name))
    alike = [name for name in tendons if name and core(name) in _own(column.name)]
    if said & LENGTH and len(alike) == 1:
        return alike[0]
    return tendons[0] if said & TENDON and len(tendons) == 1 else ""
