"""Mechanics of a servo: friction, inertia, play and load."""

from bns.worlds.effects.base import Parameter, ServoEffect


class ServoArmature(ServoEffect):
    """Inertia of rotor and gears."""

    name = "servo_armature"
    stage = "body"
    number = "armature"
    doc = "the rotor's inertia, seen at the output, differs"
    source = "rotor inertia times gear ratio squared; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "inertia",
            unit="kg m2",
            nominal=0.0,
            low=-0.1,
            high=0.5,
            doc="inertia added, negative takes away",
            example=0.02,
        ),
    )


class ServoBacklash(ServoEffect):
    """Play between gears and lever."""

    name = "servo_backlash"
    stage = "body"
    number = "backlash"
    doc = "play between gears and lever"
    source = "two inertias that meet without a bounce; bounds assumed"
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.3,
            doc="full play added",
            example=0.02,
        ),
    )


class ServoCoulomb(ServoEffect):
    """Dry friction beside the nominal one."""

    name = "servo_coulomb"
    stage = "body"
    number = "coulomb"
    doc = "dry friction differs"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "torque",
            unit="N m",
            nominal=0.0,
            low=-0.5,
            high=1.0,
            doc="dry friction added, negative takes away",
            example=0.1,
        ),
    )


class ServoViscous(ServoEffect):
    """Friction that grows with speed."""

    name = "servo_viscous"
    stage = "body"
    number = "viscous"
    doc = "viscous friction differs"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "coefficient",
            unit="N m s/rad",
            nominal=0.0,
            low=-0.5,
            high=2.0,
            doc="viscous friction added, negative takes away",
            example=0.1,
        ),
    )


class ServoStribeck(ServoEffect):
    """Dry friction that fades with speed."""

    name = "servo_stribeck"
    stage = "body"
    number = "stribeck"
    doc = "extra dry friction at low speed (Stribeck)"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    parameters = (
        Parameter(
            "torque",
            unit="N m",
            nominal=0.0,
            low=-0.5,
            high=1.0,
            doc="friction added at speed 0, negative takes away",
            example=0.1,
        ),
    )


class ServoLoadFriction(ServoEffect):
    """Friction that grows with the torque that the gears carry."""

    name = "servo_load_friction"
    stage = "body"
    number = "load_friction"
    doc = "gear friction in proportion to the load"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "coefficient",
            unit="1",
            nominal=0.0,
            low=-0.5,
            high=0.8,
            doc="friction per torque added, negative takes away",
            example=0.1,
        ),
    )


class ServoLever(ServoEffect):
    """The mass sits nearer or further out."""

    name = "servo_lever"
    stage = "body"
    number = "lever"
    doc = "the lever's length differs from what is told"
    source = "the whole lever is scaled, its mass stays"
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.25,
            high=4.0,
            doc="length over length told; bounds assumed",
            example=1.2,
        ),
    )


class ServoPayload(ServoEffect):
    """The mass at the end of the lever differs."""

    name = "servo_payload"
    stage = "body"
    number = "mass"
    doc = "the lifted mass differs from what is told"
    source = "a point mass at the end of the lever"
    parameters = (
        Parameter(
            "mass",
            unit="kg",
            nominal=0.0,
            low=-2.0,
            high=5.0,
            doc="mass added, negative takes away; bounds assumed",
            example=0.2,
        ),
    )
