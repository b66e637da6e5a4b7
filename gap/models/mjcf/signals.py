"""Effects on the commands and readings of any model, by channel."""

from abc import abstractmethod

import numpy as np
from scipy.signal import lfilter

from bns.gap.models.mjcf.effect_target import ALL, PART, number
from bns.worlds.effects.base import CommandEffect, SensorEffect


class _Command(CommandEffect):
    robots = ("own",)
    choices = PART
    source = "a transform of the command signal"

    def apply(self, signal, active, rng):
        """The signal with the columns of the part changed."""
        values = signal.values.copy()
        if self.is_nominal:
            return values
        for column, channel in enumerate(signal.channels):
            if self["part"] in (ALL, channel):
                made = self.change(values[:, column], signal.dt)
                values[active, column] = made[active]
        return values

    @abstractmethod
    def change(self, told: np.ndarray, dt: float) -> np.ndarray:
        """One channel of the signal, ``(S,)``, after the effect."""


class CommandDelay(_Command):
    """Commands arrive late."""

    name = "command_delay"
    doc = "commands reach the actuators late"
    parameters = number("delay", "s", 0.0, "time from command to actuator")

    def change(self, told, dt):
        """The signal shifted; before it begins its first value holds."""
        at = np.arange(len(told)) - self["delay"] / dt
        return np.interp(at, np.arange(len(told)), told)


class CommandLag(_Command):
    """Commands are followed gradually: a first-order lag."""

    name = "command_lag"
    doc = "commands are followed gradually"
    parameters = number("time_constant", "s", 0.0, "of a first-order lag")

    def change(self, told, dt):
        """The signal through a first-order filter that starts settled."""
        keep = np.exp(-dt / max(self["time_constant"], 1e-9))
        start = [keep * told[0]]
        return lfilter([1 - keep], [1, -keep], told, zi=start)[0]


class CommandGain(_Command):
    """A command means more, or less, than it should."""

    name = "command_gain"
    doc = "a command is scaled on its way"
    parameters = number("factor", "1", 1.0, "what arrives over what was told")

    def change(self, told, dt):
        """The signal scaled."""
        return told * self["factor"]


class CommandOffset(_Command):
    """A constant is added to a command."""

    name = "command_offset"
    doc = "a command is shifted by a constant on its way"
    parameters = number("added", "SI", 0.0, "added to the command")

    def change(self, told, dt):
        """The signal shifted in value."""
        return told + self["added"]


class CommandDeadZone(_Command):
    """Small commands do nothing."""

    name = "command_dead_zone"
    doc = "small commands do nothing"
    parameters = number("size", "SI", 0.0, "largest magnitude that does nothing")

    def change(self, told, dt):
        """The signal with what is small set to zero."""
        return np.where(np.abs(told) < self["size"], 0.0, told)


class _Sensor(SensorEffect):
    robots = ("own",)
    choices = PART
    source = "a transform of what is observed"

    def apply(self, times, readings, channels, active, rng):
        """The readings with the columns of the part changed."""
        made = readings.copy()
        if self.is_nominal:
            return made
        for column, channel in enumerate(channels):
            if self["part"] in (ALL, channel):
                changed = self.change(times, readings[:, column])
                made[active, column] = changed[active]
        return made

    @abstractmethod
    def change(self, times: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """One channel, ``(T,)``, after the effect."""


class SensorGain(_Sensor):
    """A sensor reads more, or less, than there is."""

    name = "sensor_gain"
    doc = "a sensor's readings are scaled"
    parameters = number("factor", "1", 1.0, "reading over the true value")

    def change(self, times, readings):
        """The readings scaled."""
        return readings * self["factor"]


class SensorOffset(_Sensor):
    """A sensor's zero is off."""

    name = "sensor_offset"
    doc = "a sensor's readings are shifted by a constant"
    parameters = number("added", "SI", 0.0, "added to the reading")

    def change(self, times, readings):
        """The readings shifted in value."""
        return readings + self["added"]


class SensorDelay(_Sensor):
    """What is observed is old."""

    name = "sensor_delay"
    doc = "readings are older than their time stamps"
    parameters = number("delay", "s", 0.0, "age of a reading")

    def change(self, times, readings):
        """The readings shifted in time."""
        return np.interp(times - self["delay"], times, readings)
