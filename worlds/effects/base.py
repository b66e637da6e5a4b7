"""An effect: one departure of a robot or world from its nominal model.

An effect acts at exactly one stage of the signal path

    command -> actuator -> body/contact -> sensor -> tracking

and each stage is one abstract class here. Its parameters have a unit, bounds and a
nominal value; at the nominal values the effect changes nothing, bit for bit. The same
library serves as damage, as imperfect reality, as candidate explanation of a
sim-to-real gap, and as correction of a simulator.

An effect is a class in a file here or in a folder here; `registry` finds it by its
`name`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.random import Generator

from bns.errors import BnsError, UnknownNameError
from bns.worlds.effects.leg_sets import SERVO, chosen
from bns.worlds.effects.parameter import Choice, Parameter, factor, place, strength
from bns.worlds.physics.servo_law import clipped

__all__ = [
    "ActuatorEffect",
    "BodyEffect",
    "Choice",
    "CommandEffect",
    "ControlSignal",
    "Effect",
    "ModelEdit",
    "OpticsEffect",
    "Parameter",
    "PoseSignal",
    "SensorEffect",
    "ServoEffect",
    "TrackingEffect",
    "factor",
    "place",
    "strength",
]

STAGES = ("command", "actuator", "body", "sensor", "tracking")


@dataclass(frozen=True, eq=False)
class ControlSignal:
    """What reaches a robot's actuators during one trial, on the physics grid.

    Attributes:
        times: start of each physics step [s], shape ``(S,)``.
        values: command in force at each step, shape ``(S, C)``, SI units.
        command: index of that command in the list, shape ``(S,)``; -1 after the last.
        channels: names of the C columns.
        dt: physics step [s].
    """

    times: np.ndarray
    values: np.ndarray
    command: np.ndarray
    channels: tuple[str, ...]
    dt: float

    def column(self, name: str) -> int:
        """Column index of a channel."""
        return self.channels.index(name)


@dataclass(frozen=True, eq=False)
class PoseSignal:
    """What the tracker sees during one trial: samples on the observation grid.

    Attributes:
        times: time stamps [s], shape ``(T,)``.
        poses: planar poses in the world frame, shape ``(T, 3)``; NaN = lost.
        fine_times: the physics grid [s], shape ``(S + 1,)``, for delays.
        fine_poses: true poses on it, shape ``(S + 1, 3)``.
        place: name of what is tracked.
    """

    times: np.ndarray
    poses: np.ndarray
    fine_times: np.ndarray
    fine_poses: np.ndarray
    place: str = "robot"


class Effect(ABC):
    """One departure from the nominal model, with its parameter values.

    Subclasses say what they are in class variables; they add no `__init__`. One with a
    single parameter gives it as `parameter`, others give `parameters`. The first line
    of a subclass's docstring is its `doc`, unless it gives another.

    Args:
        values: parameter and choice values by name; missing ones take the
            parameter's nominal value (the choice's default).

    Raises:
        UnknownNameError: a value for a parameter the effect does not have.
        OutOfBoundsError: a value outside its bounds, or NaN.
    """

    name: ClassVar[str]
    stage: ClassVar[str]
    doc: ClassVar[str]  # one line: what departs from nominal
    parameter: ClassVar[Parameter]  # the only one, where there is one
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    choices: ClassVar[tuple[Choice, ...]] = ()
    robots: ClassVar[tuple[str, ...]] = ("wheeled",)  # kinds it makes sense for
    random: ClassVar[bool] = False  # whether it draws from the generator
    source: ClassVar[str] = ""  # page, paper or "assumed" for the model

    def __init_subclass__(cls, **words: Any) -> None:
        super().__init_subclass__(**words)
        if "parameter" in cls.__dict__:
            cls.parameters = (cls.parameter,)
        if "doc" not in cls.__dict__ and cls.__doc__:
            first = cls.__doc__.partition("\n")[0]
            cls.doc = first[:1].lower() + first[1:].removesuffix(".")

    def __init__(self, values: Mapping[str, Any] | None = None):
        given = dict(values or {})
        known = [item.name for item in self.parameters]
        known += [item.name for item in self.choices]
        for name in given:
            if name not in known:
                raise UnknownNameError(f"parameter of {self.name}", name, known)
        self.values: dict[str, Any] = {}
        for choice in self.choices:
            value = given.get(choice.name, choice.default)
            self.values[choice.name] = choice.check(self.name, value)
        for parameter in self.parameters:
            value = given.get(parameter.name, parameter.nominal)
            self.values[parameter.name] = parameter.check(self.name, value)

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Effect) or type(self) is not type(other):
            return False
        return self.values == other.values

    def __hash__(self) -> int:
        return hash((self.name, tuple(self.values.items())))

    def __repr__(self) -> str:
        return f"<Effect {self}>"

    def __str__(self) -> str:
        """The effect as text: ``name:parameter=value,...`` (parses back)."""
        silent: dict[str, float | str] = {
            item.name: item.default for item in self.choices if item.quiet
        }
        silent |= {item.name: item.nominal for item in self.parameters if item.quiet}
        items = (
            f"{name}={value!r}".removesuffix(".0")
            if isinstance(value, float)
            else f"{name}={value}"
            for name, value in self.values.items()
            if silent.get(name) != value
        )
        text = ",".join(items)
        return f"{self.name}:{text}" if text else self.name

    @property
    def is_nominal(self) -> bool:
        """Whether every parameter that severity scales has its nominal value."""
        return all(
            self.values[p.name] == p.nominal for p in self.parameters if p.scales
        )

    def scaled(self, severity: float) -> "Effect":
        """The effect at a share of its strength: 0 nominal, 1 as given.

        Raises:
            BnsError: severity outside 0..1.
        """
        if not 0.0 <= severity <= 1.0:
            raise BnsError(f"severity = {severity} is not allowed: give 0 to 1.")
        values = dict(self.values)
        for p in self.parameters:
            if not p.scales or severity == 1.0:
                continue
            value = p.nominal + severity * (values[p.name] - p.nominal)
            values[p.name] = round(value) if p.integer else value
        return type(self)(values)

    def in_trial(self, since: int) -> "Effect":
        """The effect so many trials after it set in, where it depends on them."""
        del since
        return self

    def lost(self) -> frozenset[int]:
        """Numbers of the legs that no longer carry a walking robot."""
        return frozenset()

    def wheels(self) -> tuple[str, ...]:
        """The wheels that the choice `wheel` names: ("left",), ("right",) or both."""
        wheel = self.values.get("wheel", "both")
        return ("left", "right") if wheel == "both" else (wheel,)


class CommandEffect(Effect):
    """Changes what the robot is told: a transform of the command signal.

    What it makes of a step depends on that step and those before it alone: robots that
    close a loop get their commands one by one.

    Attributes:
        memoryless: whether it depends on that step alone, and draws nothing: then it
            is applied to one command at a time.
    """

    stage = "command"
    memoryless: ClassVar[bool] = False

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """The signal's values after the effect.

        Args:
            signal: the commands on the physics grid (not to be written to).
            active: where in time the effect is on, shape ``(S,)``.
            rng: the only source of randomness.

        Returns:
            New values, shape ``(S, C)``; equal to `signal.values` where not active.
        """
        values = signal.values.copy()
        if not self.is_nominal:
            self._change(replace(signal, values=values), active)
        return values

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        """Change `signal.values`, a copy, in place: what most effects write.

        Others, which draw from the generator say, have an `apply` of their own.
        """
        raise NotImplementedError


class ActuatorEffect(CommandEffect):
    """Changes what the actuators make of a command: the same transform, later."""

    stage = "actuator"


class BodyEffect(Effect):
    """Changes the robot or floor: an edit of the model before compilation."""

    stage = "body"
    resizes: ClassVar[bool] = False  # whether it changes the sizes of the model

    def edit(self, spec: Any) -> None:
        """Write the effect into `spec` (a `mujoco.MjSpec`), elements found by name.

        Keeps the sizes of the model, unless the class says that it `resizes`; one that
        changes the number of joints can not set in within a trial. Actuators that it
        adds are controlled by nobody.
        """
        if not self.is_nominal:
            self._write(spec)

    def _write(self, spec: Any) -> None:
        """`edit` of an effect that is not nominal; subclasses have one of the two."""
        raise NotImplementedError


class ServoEffect(Effect):
    """Changes a number of the servo law (`bns.worlds.physics.servo_law`).

    A servo closes a loop around its own encoder, so its gain, friction, delay or play
    can not be written as a transform of a signal that is known beforehand, nor as an
    edit of a model alone. All of them are numbers of one law, at whatever stage of the
    signal path they act; `stage` says which. Subclasses set it. On a walking robot the
    choice `servo` says which of its servos.

    Attributes:
        number: of the law; the effect's parameter is multiplied by it where the nominal
            is 1, else added, and the result stays inside the number's bounds.
    """

    robots: ClassVar[tuple[str, ...]] = ("servo",)
    choices = (SERVO,)
    number: ClassVar[str]

    def change(self, law: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The law after the effect: every number by name, arrays of any shape."""
        before, strength = law[self.number], self[self.parameter.name]
        scaled = self.parameter.nominal == 1
        after = before * strength if scaled else before + strength
        return {**law, self.number: clipped(self.number, after)}

    def edit(self, spec: Any) -> None:
        """Write the effect into the chosen servos of a walking robot's `MjSpec`."""
        from bns.worlds.physics import servo_law

        if self.is_nominal:
            return
        for actuator in chosen(spec, self["servo"]):
            law, powered = servo_law.read(actuator)
            servo_law.write(spec, actuator, self.change(law), powered)


ModelEdit: TypeAlias = BodyEffect | ServoEffect
"""What is written into a model before compilation."""


class OpticsEffect(Effect):
    """Changes numbers of the light law (`bns.worlds.light.law`): lamps or sensors.

    What light does before it is a reading can not be written as a transform of the
    readings: they have saturated. All such effects are numbers of one law.
    """

    stage = "sensor"

    @abstractmethod
    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        """The law after the effect, without a robot axis.

        Args:
            law: every number by name; not to be written to.
            sensors: names of the S sensors.

        Returns:
            every number by name, of the same shape as in `law`.
        """


class SensorEffect(Effect):
    """Changes what a sensor reads: a transform of sensor samples."""

    stage = "sensor"

    @abstractmethod
    def apply(
        self,
        times: np.ndarray,
        readings: np.ndarray,
        channels: tuple[str, ...],
        active: np.ndarray,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """The readings after the effect.

        A reading depends on that reading and those before it alone, and the effect
        draws what it draws reading by reading: robots that close a loop get their
        readings one by one.

        Args:
            times: of the readings [s], shape ``(T,)``.
            readings: shape ``(T, S)`` [counts]; not to be written to.
            channels: names of the S sensors.
            active: where in time the effect is on, shape ``(T,)``.
            rng: the only source of randomness.

        Returns:
            New readings, ``(T, S)``; equal to those given where not active.
        """


class TrackingEffect(Effect):
    """Changes what the tracker reports: poses, time stamps, drop-outs."""

    stage = "tracking"

    def apply(
        self, signal: PoseSignal, active: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Time stamps ``(T,)`` and poses ``(T, 3)`` after the effect.

        Args:
            signal: time stamps and poses (not to be written to).
            active: where in time the effect is on, shape ``(T,)``.
            rng: the only source of randomness.
        """
        times, poses = signal.times.copy(), signal.poses.copy()
        if not self.is_nominal:
            self._change(replace(signal, times=times, poses=poses), active, rng)
        return times, poses

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        """`apply` in place, on copies of times and poses; subclasses have one of them.

        It is asked only of effects that are not nominal.
        """
        raise NotImplementedError
