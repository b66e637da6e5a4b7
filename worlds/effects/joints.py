"""Joints of any model: friction, inertia, stiffness, play, stops, zero."""

from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, Parameter, place, strength
from bns.worlds.effects.parts import ANY, UNSERVOED, WIDE


def added(unit: str, number: str, example: float, what: str = "joint") -> Parameter:
    """A parameter: what is added to a number of a part.

    Args:
        unit: of the number.
        number: in words.
        example: value that is felt.
        what: the part is.
    """
    doc = f"added to the {what}'s {number}, which stays 0 at least"
    return strength("added", unit, (-WIDE, WIDE), doc, example=example)


class PartNumber(BodyEffect):
    """Something is added to a number of a part.

    Attributes:
        field: what a `mujoco.MjSpec` calls it.
    """

    field: ClassVar[str]

    @abstractmethod
    def _held(self, spec: Any) -> list[Any]:
        """The parts."""

    def _write(self, spec: Any) -> None:
        for item in self._held(spec):
            now = float(np.ravel(getattr(item, self.field))[0])
            parts.put(item, self.field, max(now + self["added"], 0.0))


class _JointNumber(PartNumber):
    """Something is added to a number of a joint."""

    choices = parts.part("joint")
    source = "MuJoCo's joint model"

    def _held(self, spec: Any) -> list[Any]:
        return parts.joints(spec, self["part"])


class JointDamping(_JointNumber):
    """A joint is damped more, or less, than the model says."""

    name, field, robots = "joint_damping", "damping", UNSERVOED
    parameter = added("N m s/rad or N s/m", "damping", 0.05)


class JointFriction(_JointNumber):
    """A joint has more, or less, dry friction than the model says."""

    name, field, robots = "joint_friction", "frictionloss", UNSERVOED
    parameter = added("N m or N", "friction loss", 0.1)


class JointArmature(_JointNumber):
    """A joint carries more, or less, rotor inertia than the model says."""

    name, field, robots = "joint_armature", "armature", UNSERVOED
    parameter = added("kg m2 or kg", "armature", 0.02)


class JointStiffness(_JointNumber):
    """A joint is held by a spring that the model does not know."""

    name, field, robots = "joint_stiffness", "stiffness", ANY
    parameter = added("N m/rad or N/m", "stiffness", 2.0)


class JointStribeck(BodyEffect):
    """A joint sticks: extra dry friction at low speed (Stribeck).

    See `parts.stick`.
    """

    name = "joint_stribeck"
    source = "LuGre: Canudas de Wit et al., IEEE TAC 40(3), 1995; MuJoCo's dcmotor"
    robots = ("own",)
    choices = parts.part("joint")
    resizes = True
    parameters = (
        strength(
            "torque", "N m or N", (0.0, WIDE), "friction at standstill", example=0.5
        ),
        place(
            "speed",
            "rad/s or m/s",
            0.1,
            (1e-4, WIDE),
            "at which it has faded to 37 %; nominal assumed",
        ),
    )

    def _write(self, spec: Any) -> None:
        held = parts.joints(spec, self["part"])
        parts.stick(spec, held, self["torque"], self["speed"])


class JointBacklash(BodyEffect):
    """Play between a joint's drive and what it moves.

    What drives and reads the joint is on the motor's side of the play.

    Attributes:
        called: how the name of the play goes on after that of the joint.
    """

    name = "joint_backlash"
    called: ClassVar[str] = parts.PLAY
    source = "backlash as a joint of its own with stops; bounds assumed"
    robots = ("own",)
    choices = parts.part("joint")
    resizes = True
    parameter = strength("play", "rad or m", (0.0, 1.0), "full play", example=0.1)

    def _write(self, spec: Any) -> None:
        for joint in parts.joints(spec, self["part"]):
            parts.loosen(spec, joint, self["play"], called=self.called)


class OutputBacklash(JointBacklash):
    """Play between a joint's drive and what it moves, with the encoder behind it.

    What drives the joint is on the motor's side of the play, what reads it on the other
    (an absolute encoder at the output). A position servo of the model still goes by
    its motor's side.
    """

    name = "output_backlash"
    called = parts.SEEN_PLAY


NARROW = 1e-6  # [rad or m] or degrees; MuJoCo refuses a joint without any way to go


class JointStop(BodyEffect):
    """A joint meets a stop that the model does not know: a shelf, a cable, a bent part.

    Stops that the model has stay. How soft the stop is follows from the model
    (`solreflimit` of the joint).
    """

    name = "joint_stop"
    source = "MuJoCo's joint limits"
    robots = ("own",)
    choices = parts.part("joint")
    parameters = (
        Parameter("low", "rad or m", -WIDE, -WIDE, WIDE, "lowest position", -0.05),
        Parameter("high", "rad or m", WIDE, -WIDE, WIDE, "highest position", 0.05),
    )

    def _write(self, spec: Any) -> None:
        for joint in parts.joints(spec, self["part"]):
            low, high = (
                parts.in_file(spec, joint, self[end]) for end in ("low", "high")
            )
            if int(joint.limited) and joint.range[0] != joint.range[1]:
                low, high = max(low, joint.range[0]), min(high, joint.range[1])
            joint.range, joint.limited = (low, max(high, low + NARROW)), True


def _pushed(side: str, example: float) -> Parameter:
    """Stiffness of a spring that is met on one side of a position."""
    doc = f"stiffness of a spring that is met {side} a position"
    return strength(side, "N m/rad or N/m", (0.0, WIDE), doc, example=example)


def _from(end: str, side: str) -> Parameter:
    """The position from which such a spring pushes back."""
    return place(end, "rad or m", 0.0, (-WIDE, WIDE), f"{side} which it is met")


class JointBumper(BodyEffect):
    """A spring pushes a joint back from a position on: a bumper, a cable, a hose."""

    name = "joint_bumper"
    source = "MuJoCo's tendon springs, slack within a range (springlength)"
    robots = ("own",)
    choices = parts.part("joint")
    resizes = True
    parameters = (
        _pushed("below", 40.0),
        _from("low", "below"),
        _pushed("above", 40.0),
        _from("high", "above"),
    )

    def _write(self, spec: Any) -> None:
        for joint in parts.joints(spec, self["part"]):
            low, high = (self["low"], WIDE), (-WIDE, self["high"])
            for side, slack in (("below", low), ("above", high)):
                if self[side]:
                    spring = spec.add_tendon(name=f"{joint.name}_{side}")
                    spring.wrap_joint(joint.name, 1.0)
                    spring.springlength = slack
                    parts.put(spring, "stiffness", self[side])


class EncoderOffset(BodyEffect):
    """A joint's encoder reads a constant too much, its servo goes by it.

    What is read and what is controlled is the reading: a position servo that is told
    an angle stands short of it by the offset, and reports the angle told. End stops
    and springs stay where they are on the robot.
    """

    name = "encoder_offset"
    source = "MuJoCo's joint coordinate, shifted; bounds: half a turn"
    robots = ("own",)
    choices = parts.part("joint")
    parameter = strength(
        "added", "rad or m", (-3.2, 3.2), "reading minus true position", example=0.1
    )

    def _write(self, spec: Any) -> None:
        for joint in parts.joints(spec, self["part"]):
            shift = parts.in_file(spec, joint, self["added"])
            joint.ref += shift
            joint.springref += shift
            if joint.range[0] != joint.range[1]:
                joint.range = [joint.range[0] + shift, joint.range[1] + shift]
