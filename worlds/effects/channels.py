"""Commands and readings of any robot, channel by channel.

Light sensors have effects of their own, within the range of their converter:
`sensor_gain`, `sensor_offset`, `sensor_response_time`.
"""

from abc import abstractmethod

import numpy as np

from bns.worlds.effects import parts
from bns.worlds.effects.base import (
    CommandEffect,
    ControlSignal,
    Parameter,
    SensorEffect,
    factor,
    strength,
)
from bns.worlds.effects.command import Fading, lagged
from bns.worlds.effects.parts import ANY, WIDE


def _number(
    name: str, unit: str, nominal: float, doc: str, example: float, low: float = 0.0
) -> Parameter:
    return Parameter(
        name,
        unit=unit,
        nominal=nominal,
        low=low,
        high=WIDE,
        doc=doc,
        example=example,
    )


class _Command(CommandEffect):
    """What one channel is told becomes something else."""

    robots = ANY
    choices = parts.part("channel")
    source = "a transform of the command signal"

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        """The columns of the part changed."""
        for column in parts.among(signal.channels, self["part"], "command channel"):
            told = signal.values[:, column]
            told[active] = self.change(told, signal.dt)[active]

    @abstractmethod
    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """One channel of the signal, ``(S,)``, after the effect."""


class CommandDelay(_Command):
    """Commands reach the actuators late."""

    name = "command_delay"
    parameter = _number(
        "delay", "s", 0.0, "from command to actuator; negative: early", 0.2, -WIDE
    )

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal shifted in time, ``(S,)``."""
        at = np.arange(len(told)) - self["delay"] / dt
        return np.interp(at, np.arange(len(told)), told)


class CommandLag(_Command):
    """Commands are followed gradually."""

    name = "command_lag"
    parameter = _number("time_constant", "s", 0.0, "of a first-order lag", 0.2)

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal through a first-order filter, ``(S,)``."""
        return lagged(told, told[0], max(self["time_constant"], 1e-9), dt)


class CommandGain(_Command):
    """A command is scaled on its way."""

    name = "command_gain"
    memoryless = True
    parameter = _number("factor", "1", 1.0, "what arrives over what was told", 0.8)

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal scaled, ``(S,)``."""
        return told * self["factor"]


class CommandFade(Fading, _Command):
    """Commands do less from trial to trial: one battery drives all of them."""

    name = "command_fade"
    memoryless = True

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal scaled, ``(S,)``."""
        return told * self.share


class CommandOffset(_Command):
    """A command is shifted by a constant on its way."""

    name = "command_offset"
    memoryless = True
    parameter = _number(
        "added", "unit of the command", 0.0, "added to the command", 0.05, -WIDE
    )

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal shifted in value, ``(S,)``."""
        return told + self["added"]


class CommandDeadZone(_Command):
    """Commands lose a size, and do nothing below it: play of a valve, a thruster."""

    name = "command_dead_zone"
    memoryless = True
    parameter = _number(
        "size", "unit of the command", 0.0, "taken off every magnitude", 0.05
    )

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal nearer to zero by the size, ``(S,)``."""
        return np.sign(told) * np.maximum(np.abs(told) - self["size"], 0.0)


class CommandDeadBand(_Command):
    """Small commands do nothing; larger ones arrive whole."""

    name = "command_dead_band"
    memoryless = True
    parameter = _number(
        "size", "unit of the command", 0.0, "largest magnitude of no effect", 0.05
    )

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal with what is small set to zero, ``(S,)``."""
        return np.where(np.abs(told) < self["size"], 0.0, told)


class CommandPlay(_Command):
    """Play between what is told and what arrives: a horn, a rod, a cable in its sheath.

    What arrives stays until the command has gone through the play, and then follows it
    at half of that behind (the play operator of hysteresis).
    """

    name = "command_play"
    parameter = _number(
        "width", "unit of the command", 0.0, "of the play, from stop to stop", 0.05
    )

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal behind the play, in whose middle it begins, ``(S,)``."""
        del dt
        half = self["width"] / 2
        made, now = np.empty_like(told), told[0]
        for at, goal in enumerate(told):
            now = min(max(now, goal - half), goal + half)
            made[at] = now
        return made


class CommandLimit(_Command):
    """A command is cut to a limit: a speed or torque limit of its drive."""

    name = "command_limit"
    memoryless = True
    parameter = _number(
        "limit", "unit of the command", WIDE, "largest magnitude; 1e9 is none", 0.06
    )

    def scaled(self, severity: float) -> "CommandLimit":
        """Milder means a wider limit: half the severity doubles it."""
        limit = self["limit"] / severity if severity > 0 else WIDE
        values = {**super().scaled(severity).values, "limit": min(limit, WIDE)}
        return type(self)(values)

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal within the limit, ``(S,)``."""
        return np.clip(told, -self["limit"], self["limit"])


class CommandRate(_Command):
    """A command changes no faster than a limit: a servo's speed limit."""

    name = "command_rate"
    parameter = _number(
        "time_per_unit",
        "s per unit of the command",
        0.0,
        "time that a change by one unit takes at least; 0.2 s/rad is 5 rad/s",
        2.0,
    )

    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """The signal followed at the largest rate from its first value, ``(S,)``."""
        most = dt / self["time_per_unit"]
        made, now = np.empty_like(told), told[0]
        for at, goal in enumerate(told):
            now = min(max(goal, now - most), now + most)
            made[at] = now
        return made


class _Reading(SensorEffect):
    """What is read of one channel becomes something else."""

    robots = ("own",)
    choices = parts.part("channel")
    source = "a transform of what is observed"

    def apply(
        self,
        times: np.ndarray,
        readings: np.ndarray,
        channels: tuple[str, ...],
        active: np.ndarray,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """The readings with the columns of the part changed."""
        made = readings.copy()
        if self.is_nominal:
            return made
        for column in parts.among(channels, self["part"], "observed channel"):
            changed = self.change(times, readings[:, column])
            made[active, column] = changed[active]
        return made

    @abstractmethod
    def change(self, times: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """One channel, ``(T,)``, after the effect."""


class ReadingGain(_Reading):
    """The readings of any sensor are scaled."""

    name = "reading_gain"
    parameter = factor((0.0, WIDE), "reading over the true value", example=0.8)

    def change(self, times: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """The readings scaled, ``(T,)``."""
        return readings * self["factor"]


class ReadingOffset(_Reading):
    """The readings of any sensor are shifted by a constant."""

    name = "reading_offset"
    parameter = strength(
        "added",
        "unit of the reading",
        (-WIDE, WIDE),
        "added to the reading",
        example=0.1,
    )

    def change(self, times: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """The readings shifted in value, ``(T,)``."""
        return readings + self["added"]


class ReadingDelay(_Reading):
    """The readings of any sensor are older than their time stamps."""

    name = "reading_delay"
    parameter = strength("delay", "s", (-WIDE, WIDE), "age of a reading", example=0.5)

    def change(self, times: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """The readings shifted in time, ``(T,)``."""
        return np.interp(times - self["delay"], times, readings)
