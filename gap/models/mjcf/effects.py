"""Effects on any MJCF model, by name.

They are like those of the library (`bns.worlds.effects`), except that the part they
act on is a name of the user's own model; hence they are no part of its registry.
"""

from collections.abc import Mapping
from typing import Any

from bns.errors import BnsError, UnknownNameError
from bns.gap.models.mjcf import bodies, signals
from bns.worlds.effects.base import Effect

CLASSES: Mapping[str, type[Effect]] = {
    item.name: item
    for item in (
        bodies.JointDamping,
        bodies.JointFriction,
        bodies.JointArmature,
        bodies.JointStiffness,
        bodies.BodyMass,
        bodies.ActuatorGain,
        bodies.GeomFriction,
        signals.CommandDelay,
        signals.CommandLag,
        signals.CommandGain,
        signals.CommandOffset,
        signals.CommandDeadZone,
        signals.SensorGain,
        signals.SensorOffset,
        signals.SensorDelay,
    )
}
"""all of them by name"""

OWNERS = {
    "joint_damping": "joint",
    "joint_friction": "joint",
    "joint_armature": "joint",
    "joint_stiffness": "joint",
    "body_mass": "body",
    "actuator_gain": "actuator",
    "geom_friction": "geom",
}
"""kind of part of the effects on the model; the others act on channels"""


def make(name: str, values: Mapping[str, Any]) -> Effect:
    """An effect by name.

    Raises:
        UnknownNameError: no such effect or parameter.
        OutOfBoundsError: a value that is not allowed.
    """
    if name not in CLASSES:
        raise UnknownNameError("effect on a model of your own", name, CLASSES)
    return CLASSES[name](values)


def parse(text: str) -> Effect:
    """The effect written as ``joint_damping:part=elbow,added=0.05``.

    Raises:
        BnsError: it can not be read.
    """
    name, _, rest = text.strip().partition(":")
    pairs = [piece.partition("=") for piece in rest.split(",") if piece]
    if not all(equals for _, equals, _ in pairs):
        raise BnsError(
            f"Effect {text!r} cannot be read: write NAME:part=NAME,parameter=value."
        )
    return make(name.strip(), {key.strip(): value.strip() for key, _, value in pairs})
