"""The channels of a description: what each command drives, what each observation is."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import BnsError, FormatError, UnknownNameError
from bns.storage.reading import BEYOND
from bns.worlds.data.units import si_unit
from bns.worlds.trial import Channel

LOOP = ("kp", "kd", "torque")
"""of a position loop that the MJCF file lacks"""

PLACES = ("site", "body")
QUANTITIES = ("joint", "speed", *PLACES, "tendon", "gyro")
"""what an observed channel can be: position or speed of a joint, place of a site or
body, or how that is turned, length of a tendon, rate that a gyro of the model reads"""
AXES = ("x", "y", "z")
TURNS = ("roll", "pitch", "yaw")
"""how a site or body is turned in the world: by yaw, pitch and roll, in this order,
about its own z, y and x axes"""
UNITS = ("rad", "m", "rad/s", "m/s")


@dataclass(frozen=True)
class Told:
    """A command channel.

    Attributes:
        channel: name and unit.
        actuator: of the model; one without a name goes by that of its joint.
        low, high: limits of the command.
        kp, kd: gains of a position loop around the actuator [N m/rad, N m s/rad, or
            N/m, N s/m]; kp = 0: the command is the actuator's own control.
        torque: largest torque or force of that loop [N m or N]; infinity = any.
    """

    channel: Channel
    actuator: str
    low: float
    high: float
    kp: float = 0.0
    kd: float = 0.0
    torque: float = np.inf

    @classmethod
    def read(cls, name: str, table: Any, path: Path) -> "Told":
        """The channel of a table of a description.

        Args:
            name: of the channel.
            table: what the description says of it; keys as in `Told`.
            path: of the description, for messages.

        Raises:
            FormatError: something is missing, or of the wrong kind or unit.
            BnsError: a key that there is not, or numbers that contradict each other.
        """
        kind = f"key of [commands.{name}] in {path}"
        table = mapping(table, f"[commands.{name}]", path)
        known(table, ("actuator", "unit", "low", "high", *LOOP), kind)
        for key in ("actuator", "unit", "low", "high"):
            if key not in table:
                raise FormatError(f"{path}: [commands.{name}] lacks {key!r}.")
        low, high = (number(table[key], key, path) for key in ("low", "high"))
        if not low < high:
            raise BnsError(f"{path}: [commands.{name}] needs low < high.")
        channel = _channel(name, table["unit"], path)
        loop = {key: number(table[key], key, path) for key in LOOP if key in table}
        if loop and not (loop.get("kp", 0) > 0 and min(loop.values()) >= 0):
            raise BnsError(
                f"{path}: the loop of [commands.{name}] needs a positive kp, and kd "
                "and torque not below 0."
            )
        return cls(channel, str(table["actuator"]), low, high, **loop)


@dataclass(frozen=True)
class Seen:
    """An observed channel.

    Attributes:
        channel: name and unit.
        quantity: one of `QUANTITIES`.
        part: name of the joint, site, body, tendon or gyro.
        axis: of a site or body, in the world frame: number among `AXES` and `TURNS`; of
            a gyro its own, among `AXES`.
        noise: standard deviation of its measurement, in its unit.
        scatter: of what the robot itself scatters, per square root of a second.
        floats: whether it tells, with others, the state of a free body
            (`floating.told`).
    """

    channel: Channel
    quantity: str
    part: str
    axis: int
    noise: float
    scatter: float
    floats: bool = False

    @property
    def state(self) -> str:
        """What it tells of the state in which a trial begins: a joint, by its name, or
        the way of a free body; "" = nothing."""
        joint = self.part if self.quantity == "joint" else ""
        return f"{self.part}.{self.way}" if self.floats else joint

    @property
    def way(self) -> str:
        """The axis of a site or body, of `AXES` and `TURNS`; "" of what has none."""
        return (*AXES, *TURNS)[self.axis] if self.quantity in PLACES else ""

    @property
    def turning(self) -> bool:
        """Whether it is how a site or body is turned, and not where that is."""
        return self.way in TURNS

    @classmethod
    def read(cls, name: str, table: Any, path: Path) -> "Seen":
        """The channel of a table of a description.

        Args:
            name: of the channel.
            table: what the description says of it: one of `QUANTITIES`, axis, unit,
                noise, scatter.
            path: of the description, for messages.

        Raises:
            FormatError: something is missing, or of the wrong kind or unit.
            BnsError: a key that there is not, or numbers that contradict each other.
        """
        table = mapping(table, f"[observed.{name}]", path)
        allowed = (*QUANTITIES, "axis", "unit", "noise", "scatter")
        known(table, allowed, f"key of [observed.{name}] in {path}")
        what = [key for key in QUANTITIES if key in table]
        noise = number(table.get("noise", 0), "noise", path, 0.0)
        if len(what) != 1 or "unit" not in table or not noise > 0:
            raise FormatError(
                f"{path}: [observed.{name}] needs one of {', '.join(QUANTITIES)}, a "
                "unit and a positive noise (standard deviation of its measurement)."
            )
        axis = str(table.get("axis", "x"))
        axes = AXES if what[0] == "gyro" else (*AXES, *TURNS)
        if axis not in axes:
            raise UnknownNameError(f"axis of [observed.{name}]", axis, axes)
        channel = _channel(name, table["unit"], path)
        if channel.unit not in UNITS:
            raise FormatError(
                f"{path}: [observed.{name}] is in {channel.unit!r}; joints and places "
                f"are in {', '.join(UNITS)}."
            )
        if what[0] == "gyro" and channel.unit != "rad/s":
            raise FormatError(
                f"{path}: [observed.{name}] is in {channel.unit!r}; a gyro reads rad/s."
            )
        made = cls(
            channel,
            what[0],
            str(table[what[0]]),
            axes.index(axis),
            noise,
            number(table.get("scatter", noise), "scatter", path, 0.0),
        )
        unit = "rad" if made.turning else "m"
        if made.quantity in PLACES and channel.unit != unit:
            raise FormatError(
                f"{path}: [observed.{name}] is in {channel.unit!r}, and {axis} of a "
                f"{made.quantity} in {unit!r}; how it is turned is axis = "
                f"{', '.join(map(repr, TURNS))}."
            )
        return made


def _channel(name: str, unit: Any, path: Path) -> Channel:
    """A channel, which is in SI units.

    Raises:
        FormatError: it is in another one that is known.
    """
    unit, right = str(unit), si_unit(str(unit))
    if unit != right:
        raise FormatError(
            f"{path}: {name} is in {unit!r}; channels are in SI units. Give unit = "
            f'"{right}" here, and of its column in the log [log] "{name}" = '
            f'{{ column = "...", unit = "{unit}" }}.'
        )
    return Channel(name, unit)


def known(given: Mapping[str, Any], allowed: tuple[str, ...], kind: str) -> None:
    """Refuse keys that there are not.

    Args:
        given: a table.
        allowed: its keys that there are.
        kind: what such a key is, for messages.

    Raises:
        UnknownNameError: one is not among those allowed.
    """
    for key in given:
        if key not in allowed:
            raise UnknownNameError(kind, key, allowed)


def mapping(table: Any, where: str, path: Path) -> Mapping[str, Any]:
    """What has to be a table.

    Args:
        table: whatever was given.
        where: it stands, for messages.
        path: of the description, for messages.

    Raises:
        FormatError: it is none.
    """
    if not isinstance(table, dict):
        raise FormatError(f"{path}: {where} has to be a table.")
    return table


def number(
    value: Any, name: str, path: Path, low: float = -BEYOND, high: float = BEYOND
) -> float:
    """A number of the description.

    Args:
        value: whatever was given.
        name: what it is, for messages.
        path: of the description, for messages.
        low, high: bounds of what is allowed, in the number's own unit.

    Raises:
        FormatError: it is none, or out of bounds.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FormatError(f"{path}: {name} = {value!r} is no number.")
    if not low <= value <= high:
        raise FormatError(
            f"{path}: {name} = {value!r} is not from {low:g} to {high:g}."
        )
    return float(value)
