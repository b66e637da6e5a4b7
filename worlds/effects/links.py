"""Bodies of any model: mass, centre of mass, tilt, length, what they carry."""

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from bns.errors import BnsError
from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, Parameter, factor, place, strength
from bns.worlds.effects.mass import Inertial
from bns.worlds.effects.parts import ANY, WIDE

CONNECT = 0  # mjtEq


def _shift(axis: str, *, scales: bool = True) -> Parameter:
    return strength(
        f"d{axis}",
        "m",
        (-10.0, 10.0),
        f"away from the model's centre of mass along the body's own {axis} axis; "
        "bounds assumed",
        example=0.02 if scales else 0.0,
        scales=scales,
    )


class BodyMass(BodyEffect):
    """A body is heavier, or lighter, than the model says."""

    name = "body_mass"
    source = "parallel-axis theorem; a point mass is assumed"
    robots = ANY
    choices = parts.part("body")
    parameters = (
        strength(
            "added",
            "kg",
            (-WIDE, WIDE),
            "mass added; 1 % of the body's stays at least",
            example=0.2,
        ),
        *(_shift(axis, scales=False) for axis in "xyz"),
    )

    def _write(self, spec: Any) -> None:
        for body in parts.bodies(spec, self["part"]):
            inertial = Inertial.of(spec, body)
            added = max(self["added"], -0.99 * inertial.mass)
            away = np.array([self["dx"], self["dy"], self["dz"]])
            inertial.plus(added, inertial.centre + away).write(body)


class BodyCentre(BodyEffect):
    """A body's centre of mass lies elsewhere than in the model."""

    name = "body_centre"
    source = "rigid-body mechanics"
    robots = ANY
    choices = parts.part("body")
    parameters = (_shift("x"), _shift("y"), _shift("z"))

    def _write(self, spec: Any) -> None:
        for body in parts.bodies(spec, self["part"]):
            inertial = Inertial.of(spec, body)
            centre = inertial.centre + np.array([self["dx"], self["dy"], self["dz"]])
            replace(inertial, centre=centre).write(body)


class BodyTilt(BodyEffect):
    """A body is mounted aslant: turned about its parent's x and y axes.

    It turns with its joints and with all that it carries. Of a robot that is bolted
    down, its first body on the world is the base: a table that is not level.
    """

    name = "body_tilt"
    source = "a rotation vector in the parent's frame; bounds assumed"
    robots = ANY
    choices = parts.part("body")
    parameters = tuple(
        strength(
            name, "rad", (-1.0, 1.0), f"about the parent's {axis} axis", example=0.1
        )
        for name, axis in (("roll", "x"), ("pitch", "y"))
    )

    def _write(self, spec: Any) -> None:
        model = spec.copy().compile()
        turn, made = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, *_turn(self["roll"], self["pitch"]))
        for body in parts.bodies(spec, self["part"]):
            mujoco.mju_mulQuat(made, turn, model.body(body.name).quat)
            body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
            body.quat = made


class GravityCompensation(BodyEffect):
    """Springs, counterweights or motors carry more, or less, of a body's weight.

    All are those of which the model says that something carries them (`gravcomp`), or
    all if it says so of none.
    """

    name = "gravity_compensation"
    source = "MuJoCo's gravcomp: an upward force of that share of the body's weight"
    robots = ("own",)
    choices = parts.part("body")
    parameter = strength(
        "added", "1", (-WIDE, WIDE), "share of the weight that is carried", example=0.3
    )

    def _write(self, spec: Any) -> None:
        bodies = parts.bodies(spec, self["part"])
        carried = [body for body in bodies if body.gravcomp]
        for body in carried or bodies:
            body.gravcomp += self["added"]


def _turn(roll: float, pitch: float) -> tuple[np.ndarray, float]:
    """Axis and angle of a rotation vector."""
    angle = float(np.hypot(roll, pitch))
    return np.array([roll, pitch, 0.0]) / max(angle, 1e-12), angle


class BodyLength(BodyEffect):
    """A link is longer or shorter than in the model.

    Its length runs from its joint to the body that it carries, or to its centre of
    mass where it carries none or several. Mass stays; the centre of mass, the inertia,
    and all that sits on the body move as the stretch says, as does where it closes a
    loop.
    """

    name = "body_length"
    source = "inertia of a mass that is stretched evenly; bounds assumed"
    robots = ANY
    choices = parts.part("body")
    parameter = factor((0.1, 10.0), "length over the model's", example=1.1)

    def _write(self, spec: Any) -> None:
        for body in parts.bodies(spec, self["part"]):
            _pin(spec, body)
            inertial = Inertial.of(spec, body)
            along = _along(body, inertial)
            stretch = np.eye(3) + (self["factor"] - 1) * np.outer(along, along)
            for item in (*body.sites, *body.bodies):
                item.pos = stretch @ item.pos
            for geom in body.geoms:
                _stretch(geom, stretch, along, self["factor"])
            spread = np.trace(inertial.inertia) / 2 * np.eye(3) - inertial.inertia
            spread = stretch @ spread @ stretch  # second moments of the mass
            inertia = np.trace(spread) * np.eye(3) - spread
            centre = stretch @ inertial.centre
            replace(inertial, centre=centre, inertia=inertia).write(body)


def _pin(spec: Any, body: Any) -> None:
    """Connect the loops that a body closes by sites: of two bodies that are connected
    at an anchor MuJoCo finds the second one's from the first one's, so it would move
    along with a body that is longer."""
    loops = [
        (number, item)
        for number, item in enumerate(spec.equalities)
        if int(item.type) == CONNECT
        and item.objtype == mujoco.mjtObj.mjOBJ_BODY
        and body.name in (item.name1, item.name2)
    ]
    if not loops:
        return
    data = spec.copy().compile().eq_data
    for number, item in loops:
        names = [f"loop{number}_end{end}" for end in range(2)]
        for end, name in enumerate(names):
            owner = spec.body((item.name1, item.name2)[end] or "world")
            owner.add_site(name=name, pos=data[number, 3 * end : 3 * end + 3])
        item.objtype = mujoco.mjtObj.mjOBJ_SITE
        item.name1, item.name2 = names


def _along(body: Any, inertial: Inertial) -> np.ndarray:
    """Unit vector along a body, in its frame."""
    children = [np.array(child.pos) for child in body.bodies]
    way = children[0] if len(children) == 1 else np.array(inertial.centre)
    length = np.linalg.norm(way)
    if length < 1e-9:
        raise BnsError(f"Body {body.name!r} has no length to change.")
    return way / length


def _stretch(geom: Any, stretch: np.ndarray, along: np.ndarray, factor: float) -> None:
    """Move a geom with its body, and lengthen one that lies along it."""
    import mujoco

    if np.isfinite(geom.fromto[0]) and np.any(geom.fromto):
        ends = np.array(geom.fromto).reshape(2, 3) @ stretch
        geom.fromto = ends.ravel()
        return
    geom.pos = stretch @ geom.pos
    turned = np.empty(9)
    mujoco.mju_quat2Mat(turned, np.array(geom.quat))
    shares = np.abs(turned.reshape(3, 3).T @ along)
    long = {mujoco.mjtGeom.mjGEOM_CAPSULE: 1, mujoco.mjtGeom.mjGEOM_CYLINDER: 1}
    if geom.type == mujoco.mjtGeom.mjGEOM_BOX:
        geom.size[int(shares.argmax())] *= factor
    elif geom.type in long and shares[2] > 0.9:
        geom.size[1] *= factor


ROUND = (-0.065, 0.065)  # m; the Khepera III's body


class Payload(BodyEffect):
    """The robot carries a mass that the model does not know."""

    name = "payload"
    source = "parallel-axis theorem"
    robots = ("wheeled", "legged")
    parameters = (
        strength(
            "mass",
            "kg",
            (0.0, 2.0),
            "mass carried (the Khepera III itself: 0.69 kg); bounds assumed",
            example=0.5,
        ),
        place("x", "m", 0.0, ROUND, "ahead of the axle; bounds: the body's radius"),
        place("y", "m", 0.0, ROUND, "to the left; bounds: the body's radius"),
        place(
            "z",
            "m",
            0.07,
            (0.0, 0.3),
            "above the floor; nominal: the top plate (69 mm)",
        ),
        strength(
            "inertia",
            "kg m2",
            (0.0, 0.02),
            "of the load about its own centre, the same about all axes: 0 is a point; "
            "bounds assumed (a cube of 0.5 kg and 7 cm has 4e-4)",
            example=2e-4,
            quiet=True,
        ),
    )

    def _write(self, spec: Any) -> None:
        body = parts.base(spec)
        position = np.array([self["x"], self["y"], self["z"]])
        inertial = Inertial.of(spec, body)
        inertial.plus(self["mass"], position, self["inertia"]).write(body)


def _little(name: str, doc: str, example: float) -> Parameter:
    return strength(name, "m", (-0.03, 0.03), doc, example=example)


class CentreOfMass(BodyEffect):
    """The base's centre of mass lies elsewhere than in the model."""

    name = "centre_of_mass"
    source = "the model's 11 mm ahead of the axle has one source; bounds assumed"
    robots = ("wheeled", "legged")
    parameters = (
        _little("dx", "shift forward; beyond -11 mm the Khepera leans back", 0.01),
        _little("dy", "shift to the left", 0.01),
    )

    def _write(self, spec: Any) -> None:
        body = parts.base(spec)
        inertial = Inertial.of(spec, body)
        centre = inertial.centre + np.array([self["dx"], self["dy"], 0.0])
        replace(inertial, centre=centre).write(body)
