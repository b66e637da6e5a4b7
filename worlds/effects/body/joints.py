"""Joints of any model: damping, friction, inertia, springs, play and zero."""

from typing import Any, ClassVar

import numpy as np

from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, Parameter, strength
from bns.worlds.effects.parts import ANY, UNSERVOED, WIDE


def _added(unit: str, number: str, example: float) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "added",
            unit=unit,
            nominal=0.0,
            low=-WIDE,
            high=WIDE,
            doc=f"added to the joint's {number}, which stays 0 at least",
            example=example,
        ),
    )


class _JointNumber(BodyEffect):
    """Something is added to a number of a joint."""

    choices = parts.part("joint")
    source = "MuJoCo's joint model"
    field: ClassVar[str]

    def _write(self, spec: Any) -> None:
        for joint in parts.joints(spec, self["part"]):
            value = np.array(getattr(joint, self.field), dtype=float)
            flat = value.reshape(-1)
            flat[0] = max(flat[0] + self["added"], 0.0)
            setattr(joint, self.field, value if value.ndim else float(value))


class JointDamping(_JointNumber):
    """A joint is damped more, or less, than the model says."""

    name, field, robots = "joint_damping", "damping", UNSERVOED
    parameters = _added("N m s/rad or N s/m", "damping", 0.05)


class JointFriction(_JointNumber):
    """A joint has more, or less, dry friction than the model says."""

    name, field, robots = "joint_friction", "frictionloss", UNSERVOED
    parameters = _added("N m or N", "friction loss", 0.1)


class JointArmature(_JointNumber):
    """A joint carries more, or less, rotor inertia than the model says."""

    name, field, robots = "joint_armature", "armature", UNSERVOED
    parameters = _added("kg m2 or kg", "armature", 0.02)


class JointStiffness(_JointNumber):
    """A joint is held by a spring that the model does not know."""

    name, field, robots = "joint_stiffness", "stiffness", ANY
    parameters = _added("N m/rad or N/m", "stiffness", 2.0)


class JointStribeck(BodyEffect):
    """A joint sticks: extra dry friction at low speed (Stribeck).

    friction = torque exp(-(v / speed)^2) in steady motion, by bristles that give way
    (LuGre). Their stiffness and damping follow from the joint's inertia and the
    physics step: before it slips, the joint moves by torque / stiffness. It is an
    actuator of its own, behind the others, which nothing controls.
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
        Parameter(
            "speed",
            unit="rad/s or m/s",
            nominal=0.1,
            low=1e-4,
            high=WIDE,
            doc="at which it has faded to 37 %; nominal assumed",
            example=0.1,
            scales=False,
        ),
    )
    rest: ClassVar[float] = 1e-3  # share of the friction that stays; it must not vanish
    quickness: ClassVar[float] = 0.4  # of the bristles, per physics step

    def _write(self, spec: Any) -> None:
        import mujoco

        model, rate = spec.copy().compile(), self.quickness / spec.option.timestep
        for joint in parts.joints(spec, self["part"]):
            inertia = model.dof_M0[model.joint(joint.name).dofadr[0]]
            bristles = spec.add_actuator(
                name=f"{joint.name}_stribeck",
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
                target=joint.name,
            )
            bristles.set_to_dcmotor(
                motorconst=[1e-9, 1e-9],  # no motor
                resistance=1.0,
                lugre=[
                    inertia * rate**2,
                    2 * inertia * rate,
                    self.rest * self["torque"],
                    self["torque"],
                    self["speed"],
                ],
            )
            for key in spec.keys:
                key.ctrl = np.append(np.array(key.ctrl), 0.0) if len(key.ctrl) else []
                key.act = np.append(np.array(key.act), 0.0) if len(key.act) else []


class JointBacklash(BodyEffect):
    """Play between a joint's drive and what it moves.

    What drives and reads the joint is on the motor's side of the play.
    """

    name = "joint_backlash"
    source = "backlash as a joint of its own with stops; bounds assumed"
    robots = ("own",)
    choices = parts.part("joint")
    resizes = True
    parameters = (strength("play", "rad or m", (0.0, 1.0), "full play", example=0.1),)

    def _write(self, spec: Any) -> None:
        for joint in parts.joints(spec, self["part"]):
            parts.loosen(spec, joint, self["play"])


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
    parameters = (
        strength(
            "added", "rad or m", (-3.2, 3.2), "reading minus true position", example=0.1
        ),
    )

    def _write(self, spec: Any) -> None:
        for joint in parts.joints(spec, self["part"]):
            shift = parts.in_file(spec, joint, self["added"])
            joint.ref += shift
            joint.springref += shift
            if joint.range[0] != joint.range[1]:
                joint.range = [joint.range[0] + shift, joint.range[1] + shift]
