"""Effects that the library lacks: cases "outside the library"."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from bns.worlds.effects.base import (
    BodyEffect,
    CommandEffect,
    OpticsEffect,
    Parameter,
    SensorEffect,
    TrackingEffect,
)


def _strength(nominal: float, low: float, high: float, unit: str = "1") -> Parameter:
    return Parameter(
        "strength", unit, nominal, low, high, doc="assumed", example=high / 2
    )


class OtherSolver(BodyEffect):
    """Another integrator, cone and motor: how a real robot's physics differ anyway."""

    name = "bench_other_solver"
    doc = "another integrator and friction cone, a motor 1 % stiffer"
    parameters = (_strength(0.0, 0.0, 1.0),)

    def edit(self, spec: Any) -> None:
        import mujoco

        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICIT
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        for actuator in spec.actuators:
            actuator.gainprm[0] *= 1.01
            actuator.biasprm[2] *= 1.01


class GearRipple(CommandEffect):
    """Speed of the left wheel swings as it turns (an eccentric gear)."""

    name = "bench_gear_ripple"
    doc = "a wheel's speed swings once per turn"
    parameters = (_strength(0.0, 0.0, 1.0),)

    def apply(self, signal, active, rng):
        values = signal.values.copy()
        angle = np.cumsum(values[:, 0]) * signal.dt / 0.0205
        values[:, 0] *= 1 + self["strength"] * np.sin(angle)
        return values


class CrossTalk(CommandEffect):
    """Each wheel gets a share of the other's command."""

    name = "bench_cross_talk"
    doc = "wheels get a share of each other's command"
    parameters = (_strength(0.0, 0.0, 1.0),)

    def apply(self, signal, active, rng):
        share = self["strength"]
        return (1 - share) * signal.values + share * signal.values[:, ::-1]


class Quadratic(CommandEffect):
    """Speed bends upwards: slow commands too slow, fast ones too fast."""

    name = "bench_quadratic"
    doc = "speed grows with the square of the command"
    parameters = (_strength(0.0, 0.0, 1.0),)

    def apply(self, signal, active, rng):
        ratio = np.abs(signal.values) / 0.14
        return signal.values * (1 + self["strength"] * (ratio - 0.6))


class LostCommands(CommandEffect):
    """Some commands never arrive; the one before goes on."""

    name = "bench_lost_commands"
    doc = "commands get lost at random, the one before goes on"
    parameters = (_strength(0.0, 0.0, 1.0),)
    random = True

    def apply(self, signal, active, rng):
        values = signal.values.copy()
        lost = rng.random(signal.command.max() + 1) < self["strength"]
        for index in range(1, len(lost)):
            if lost[index]:
                before = np.flatnonzero(signal.command == index - 1)[-1]
                values[signal.command == index] = values[before]
        return values


class LensDistortion(TrackingEffect):
    """Positions are squeezed away from the middle of the board."""

    name = "bench_lens_distortion"
    doc = "the tracker's lens bends positions"
    parameters = (_strength(0.0, 0.0, 5.0),)

    def apply(self, signal, active, rng):
        poses = signal.poses.copy()
        square = (poses[:, :2] ** 2).sum(axis=1, keepdims=True)
        poses[:, :2] *= 1 - self["strength"] * square
        return signal.times.copy(), poses


class HeadingField(CommandEffect):
    """The drive swings slowly in time, as from a loose contact."""

    name = "bench_slow_swing"
    doc = "the left wheel's speed swings slowly"
    parameters = (_strength(0.0, 0.0, 1.0),)

    def apply(self, signal, active, rng):
        values = signal.values.copy()
        values[:, 0] *= 1 + self["strength"] * np.sin(2 * np.pi * signal.times / 3.1)
        return values


def off_library() -> list:
    """All of them at two strengths that are felt."""
    return [
        GearRipple({"strength": 0.15}),
        GearRipple({"strength": 0.4}),
        CrossTalk({"strength": 0.05}),
        CrossTalk({"strength": 0.15}),
        Quadratic({"strength": 0.1}),
        Quadratic({"strength": 0.3}),
        LostCommands({"strength": 0.1}),
        LostCommands({"strength": 0.25}),
        LensDistortion({"strength": 0.5}),
        LensDistortion({"strength": 1.5}),
        HeadingField({"strength": 0.1}),
        HeadingField({"strength": 0.3}),
    ]


def other_solver() -> list:
    """The departure that every case has."""
    return [OtherSolver({"strength": 1.0})]


class _Always:
    """Of an effect without a parameter that could be nominal."""

    is_nominal = False


class Narrower(_Always, OpticsEffect):
    """Sensors see a narrower cone: another exponent of their angular response."""

    name = "off_narrower"
    doc = "sensors see a narrower cone"
    source = "assumed"

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """The law with twice the exponent."""
        return {**law, "exponent": law["exponent"] * 2.0}


class Nonlinear(_Always, SensorEffect):
    """Readings bend: the middle of the range is read too dark."""

    name = "off_nonlinear"
    doc = "readings bend in the middle of their range"
    source = "assumed"

    def apply(self, times, readings, channels, active, rng):
        """The readings, up to 600 counts darker."""
        share = np.clip(readings / 4095, 0, 1)
        return np.clip(readings + 2400 * share * (1 - share), 0, 4095)


class Coarse(_Always, SensorEffect):
    """Readings come in six steps."""

    name = "off_coarse"
    doc = "readings come in six steps"
    source = "assumed"

    def apply(self, times, readings, channels, active, rng):
        """The readings rounded to steps of 819 counts."""
        return np.rint(readings / 819) * 819
