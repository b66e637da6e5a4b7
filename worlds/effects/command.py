"""What wheels are told: gains, dead bands, limits, and wheels that are stuck.

What effects on signals share is here too: wheel columns, spans of time, lags.
"""

from abc import abstractmethod
from collections.abc import Iterator
from typing import Self

import numpy as np

from bns.errors import UnknownNameError
from bns.worlds.effects.base import (
    Choice,
    CommandEffect,
    ControlSignal,
    Effect,
    Parameter,
    factor,
    place,
    strength,
)

# [m/s per speed unit] Khepera III manual 2.2, p. 14 (firmware < 3): 144.01 units
# to the mm/s.
SPEED_UNIT = 1e-3 / 144.01
# [m/s] Same page: largest speed in open loop, 48,000 units.
TOP_SPEED = 0.3334  # 48,000 units are 0.33331 m/s
# [m/s] Smallest speed that the lab's controllers use, 8,000 units; below it a speed
# gene means stop.
MINIMUM_SPEED = round(8000 * SPEED_UNIT, 6)
# [m/s] Largest speed that the lab's controllers use, 17,500 units.
MAXIMUM_SPEED = round(17500 * SPEED_UNIT, 6)

WHEEL = Choice("wheel", ("left", "right", "both"), "both", "which wheel is affected")


class Fading(Effect):
    """What arrives is less from trial to trial."""

    parameters = (
        strength(
            "per_trial",
            "1",
            (0.0, 0.5),
            "share lost with each trial; bounds assumed",
            example=0.02,
        ),
        strength(
            "trials",
            "1",
            (0, 1_000_000),
            "run since the battery was full, before the first one",
            example=10,
            integer=True,
            scales=False,
        ),
    )

    @property
    def is_nominal(self) -> bool:
        """Whether nothing is lost, at all or yet."""
        return super().is_nominal or not self["trials"]

    def in_trial(self, since: int) -> Self:
        """The effect after so many trials more."""
        return type(self)({**self.values, "trials": self["trials"] + since})

    @property
    def share(self) -> float:
        """What is left of what arrived at first."""
        return float(np.exp(-self["per_trial"] * self["trials"]))


def columns(effect: Effect, signal: ControlSignal) -> list[int]:
    """Columns of the signal that the effect's choice `wheel` names."""
    return [signal.column(f"{wheel}_speed") for wheel in effect.wheels()]


def spans(active: np.ndarray) -> Iterator[slice]:
    """Contiguous stretches where `active`, ``(T,)``, is true, as slices in order."""
    edges = np.flatnonzero(np.diff(active.astype(np.int8), prepend=0, append=0))
    for start, stop in edges.reshape(-1, 2):
        yield slice(int(start), int(stop))


def rarer(effect: Effect, severity: float) -> int:
    """The parameter `every` at a severity: half of it hits half as often; 0 = never."""
    every = int(effect["every"])
    if severity <= 0 or every <= 0:
        return 0
    every = round(every / severity)
    return every if every <= effect.parameters[0].high else 0


def lagged(
    told: np.ndarray, before: float, time_constant: float, dt: float
) -> np.ndarray:
    """What follows a signal as a first-order lag, its mean over each step, ``(S,)``.

    Solved exactly for values that are constant over a step. The mean is late by the
    time constant at any step; the value at a step's end would be early by half a step.

    Args:
        told: values, ``(S,)``.
        before: value that was followed until then.
        time_constant: [s], positive.
        dt: step [s].
    """
    from scipy.signal import lfilter

    keep = np.exp(-dt / time_constant)
    begun = lfilter([0.0, 1 - keep], [1.0, -keep], told, zi=[before])[0]
    return told + (begun - told) * (1 - keep) * time_constant / dt


class _EachCommand(CommandEffect):
    """A command of the chosen wheels becomes another one, whatever came before."""

    memoryless = True
    choices = (WHEEL,)

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        values = signal.values
        for column in columns(self, signal):
            values[active, column] = self._turned(values[active, column])

    @abstractmethod
    def _turned(self, told: np.ndarray) -> np.ndarray:
        """Speeds instead of those told [m/s], any shape."""


class WheelGain(_EachCommand):
    """A wheel turns at a share of the speed it is told."""

    name = "wheel_gain"
    source = "thesis 4.2.3 and 6.2.1: a wheel slowed to a share of its intended speed"
    parameter = factor(
        (0.0, 2.0), "speed reached over speed told; bounds assumed", example=0.8
    )

    def _turned(self, told: np.ndarray) -> np.ndarray:
        return told * self["factor"]


class ReverseGain(_EachCommand):
    """A wheel turns at another share of what it is told backwards than forwards."""

    name = "reverse_gain"
    source = "drives and brushes that are set for one direction; bounds assumed"
    parameter = factor(
        (0.0, 2.0), "speed reached backwards over speed told", example=0.8
    )

    def _turned(self, told: np.ndarray) -> np.ndarray:
        return np.where(told < 0.0, told * self["factor"], told)


class DeadBand(_EachCommand):
    """Speeds below a magnitude give a stop."""

    name = "dead_band"
    source = "regulated minimum 2,000 units (13.9 mm/s): Khepera III manual 2.2 p. 14"
    parameter = strength(
        "speed",
        "m/s",
        (0.0, 0.2),
        "smallest magnitude that still moves the wheel; bounds assumed",
        example=0.08,
    )

    def _turned(self, told: np.ndarray) -> np.ndarray:
        return np.where(np.abs(told) < self["speed"], 0.0, told)


class DeadZone(_EachCommand):
    """A wheel turns slower than it is told by a constant."""

    name = "dead_zone"
    source = "the dead zone of control engineering; bounds assumed"
    parameter = strength(
        "speed",
        "m/s",
        (0.0, 0.2),
        "taken off every speed; bounds assumed",
        example=0.02,
    )

    def _turned(self, told: np.ndarray) -> np.ndarray:
        return np.sign(told) * np.maximum(np.abs(told) - self["speed"], 0.0)


class SpeedSaturation(_EachCommand):
    """A wheel turns no faster than a limit."""

    name = "speed_saturation"
    source = "limits of 48,000 and 43,000 units: Khepera III manual 2.2 p. 14"
    parameter = Parameter(
        "limit",
        unit="m/s",
        nominal=TOP_SPEED,
        low=0.0,
        high=TOP_SPEED,
        doc="largest magnitude; the nominal is the limit of the drive",
        example=0.06,
    )

    def _turned(self, told: np.ndarray) -> np.ndarray:
        return np.clip(told, -self["limit"], self["limit"])


class WheelIntermittent(CommandEffect):
    """A wheel stops (or slows to a minimum) in every m-th command."""

    name = "wheel_intermittent"
    source = "thesis 6.2.1 (stops spinning) and 6.3.1 (set to the minimum); m is silent"
    memoryless = True
    choices = (WHEEL,)
    parameters = (
        strength(
            "every",
            "1",
            (0, 1000),
            "m: commands m, 2m, ... of a trial are hit; 0 = never; bounds assumed",
            example=3,
            integer=True,
        ),
        strength(
            "speed",
            "m/s",
            (0.0, TOP_SPEED),
            "speed in the commands hit; 0 = stops, 0.0555 = 8,000 speed units",
            example=0.0,
            scales=False,
        ),
    )

    def scaled(self, severity: float) -> "WheelIntermittent":
        """Milder means rarer: half the severity hits half as many commands."""
        every = rarer(self, severity)
        return type(self)({**super().scaled(severity).values, "every": every})

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        number = signal.command + 1  # counted from 1; 0 after the last command
        hit = active & (number > 0) & (number % int(self["every"]) == 0)
        for column in columns(self, signal):
            signal.values[hit, column] = self["speed"]


DIRECTION = Choice(
    "direction",
    ("forward", "backward", "commanded"),
    "forward",
    "which way the stuck wheel turns; commanded = the way it is told, or not at all",
)

BLEND = strength(
    "blend",
    "1",
    (0.0, 1.0),
    "from the speed told (0) to the stuck speed (1)",
    example=1.0,
)


def stuck_speed(nominal: float, doc: str) -> Parameter:
    """The parameter for the speed at which a wheel is stuck [m/s]."""
    return place("speed", "m/s", nominal, (0.0, TOP_SPEED), doc)


class StuckWheel(CommandEffect):
    """A wheel turns at one speed whatever it is told, as long as commands last."""

    choices = (WHEEL, DIRECTION)
    memoryless = True

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        values = signal.values
        on = active & (signal.command >= 0)
        signs = {"forward": 1.0, "backward": -1.0}
        for column in columns(self, signal):
            told = values[on, column]
            sign = signs.get(self["direction"], np.sign(told))
            values[on, column] += self["blend"] * (sign * self["speed"] - told)


class WheelStuckMax(StuckWheel):
    """A wheel turns at the maximum speed whatever it is told."""

    name = "wheel_stuck_max"
    source = "thesis 6.2.1; maximum of 17,500 speed units: the lab's controller files"
    parameters = (
        BLEND,
        stuck_speed(
            MAXIMUM_SPEED,
            "maximum speed; 17,500 units by the lab's files (the drive reaches 48,000)",
        ),
    )


class WheelStuckMin(StuckWheel):
    """A wheel turns at the minimum speed whatever it is told."""

    name = "wheel_stuck_min"
    source = "thesis 6.2.1; minimum of 8,000 speed units: the lab's controller files"
    parameters = (
        BLEND,
        stuck_speed(
            MINIMUM_SPEED,
            "minimum speed; 8,000 units by the lab's files (0 is the other reading)",
        ),
    )


class CommandLatency(CommandEffect):
    """Commands reach the motors late.

    A delay that is no multiple of the physics step is met on average: a step in which
    the command changes gets the time-weighted mean of the two.
    """

    name = "command_latency"
    source = "0.2 s fits the MRCLAM 6 robots best; bounds assumed"
    robots = ("wheeled", "legged")
    parameter = strength(
        "delay", "s", (0.0, 2.0), "time from command to motor", example=0.2
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        steps = self["delay"] / signal.dt
        whole = int(np.floor(steps + 1e-9))  # rounding must not cost a step
        share = max(steps - whole, 0.0)
        late = _shifted(signal.values, whole)
        if share > 1e-9:
            late = (1 - share) * late + share * _shifted(signal.values, whole + 1)
        signal.values[active] = late[active]


def _shifted(values: np.ndarray, steps: int) -> np.ndarray:
    late = np.zeros_like(values)
    if steps < len(values):
        late[steps:] = values[: len(values) - steps]
    return late


TWIST = ("forward_speed", "turning_rate")
"""names of the two channels"""


class TurningLoss(CommandEffect):
    """Forward speed is lost while the robot turns, whichever way.

    Wheels scrub, and firmware that holds the faster wheel back slows both.
    """

    name = "turning_loss"
    source = "seen of iRobot Creates (MRCLAM data sets); bounds assumed"
    robots = ("own",)
    memoryless = True
    parameter = strength(
        "loss",
        "m",
        (0.0, 0.5),
        "forward speed lost over turning rate told",
        example=0.05,
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        """See `CommandEffect.apply`; forward speed never changes its sign.

        Raises:
            UnknownNameError: the robot is not told a forward speed and a turning rate.
        """
        if missing := [name for name in TWIST if name not in signal.channels]:
            raise UnknownNameError("command channel", missing[0], signal.channels)
        speed, rate = (signal.channels.index(name) for name in TWIST)
        told, turning = signal.values[:, speed], np.abs(signal.values[:, rate])
        left = np.maximum(np.abs(told) - self["loss"] * turning, 0.0)
        told[active] = (np.sign(told) * left)[active]
