"""Mechanics of a servo: friction, inertia, play and load."""

from bns.worlds.effects.base import ServoEffect, factor, strength


class ServoArmature(ServoEffect):
    """The rotor's inertia, seen at the output, differs."""

    name = "servo_armature"
    stage = "body"
    number = "armature"
    source = "rotor inertia times gear ratio squared; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        strength(
            "inertia",
            "kg m2",
            (-0.1, 0.5),
            "inertia added, negative takes away",
            example=0.02,
        ),
    )


class ServoBacklash(ServoEffect):
    """Play between gears and lever."""

    name = "servo_backlash"
    stage = "body"
    number = "backlash"
    source = "two inertias that meet without a bounce; bounds assumed"
    parameters = (
        strength("angle", "rad", (0.0, 0.3), "full play added", example=0.02),
    )


class ServoCoulomb(ServoEffect):
    """Dry friction differs."""

    name = "servo_coulomb"
    stage = "body"
    number = "coulomb"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        strength(
            "torque",
            "N m",
            (-0.5, 1.0),
            "dry friction added, negative takes away",
            example=0.1,
        ),
    )


class ServoViscous(ServoEffect):
    """Viscous friction differs."""

    name = "servo_viscous"
    stage = "body"
    number = "viscous"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        strength(
            "coefficient",
            "N m s/rad",
            (-0.5, 2.0),
            "viscous friction added, negative takes away",
            example=0.1,
        ),
    )


class ServoStribeck(ServoEffect):
    """Extra dry friction at low speed (Stribeck)."""

    name = "servo_stribeck"
    stage = "body"
    number = "stribeck"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    parameters = (
        strength(
            "torque",
            "N m",
            (-0.5, 1.0),
            "friction added at speed 0, negative takes away",
            example=0.1,
        ),
    )


class ServoLoadFriction(ServoEffect):
    """Gear friction in proportion to the load."""

    name = "servo_load_friction"
    stage = "body"
    number = "load_friction"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        strength(
            "coefficient",
            "1",
            (-0.5, 0.8),
            "friction per torque added, negative takes away",
            example=0.1,
        ),
    )


class ServoLever(ServoEffect):
    """The lever's length differs from what is told."""

    name = "servo_lever"
    stage = "body"
    number = "lever"
    source = "the whole lever is scaled, its mass stays"
    parameters = (
        factor((0.25, 4.0), "length over length told; bounds assumed", example=1.2),
    )


class ServoPayload(ServoEffect):
    """The lifted mass differs from what is told."""

    name = "servo_payload"
    stage = "body"
    number = "mass"
    source = "a point mass at the end of the lever"
    parameters = (
        strength(
            "mass",
            "kg",
            (-2.0, 5.0),
            "mass added, negative takes away; bounds assumed",
            example=0.2,
        ),
    )
