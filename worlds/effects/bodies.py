"""Where body effects find the parts of a robot in a `mujoco.MjSpec`.

Only the wheels' body names are relied on, ``left_wheel`` and ``right_wheel``; joints,
geoms, actuators and the base follow from them. Of a robot without wheels the base is
the body that floats.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from bns.errors import BnsError

FREE = 0  # mjJNT_FREE


def wheel(spec: Any, side: str) -> Any:
    """The wheel's body; `side` is "left" or "right".

    Raises:
        BnsError: the model has none.
    """
    body = spec.body(f"{side}_wheel")
    if body is None:
        raise BnsError(
            f"Model {spec.modelname!r} has no body '{side}_wheel': this effect needs "
            "a wheeled robot; see `bns robots`."
        )
    return body


def base(spec: Any) -> Any:
    """The body that carries the wheels, or the one that floats and carries the legs.

    Raises:
        BnsError: the model has neither.
    """
    if spec.body("left_wheel") is not None:
        return wheel(spec, "left").parent
    for joint in spec.joints:
        if joint.type == FREE:
            return joint.parent
    raise BnsError(
        f"Model {spec.modelname!r} has no free base: this effect needs a robot that "
        "moves about; see `bns robots`."
    )


def grounded(spec: Any) -> Iterator[Any]:
    """The bodies that carry the robot on the floor: wheels, or all parts of legs."""
    wheels = [spec.body(f"{side}_wheel") for side in ("left", "right")]
    if all(item is not None for item in wheels):
        yield from wheels
        return
    yield from base(spec).find_all("body")


def joint(spec: Any, side: str) -> Any:
    """The wheel's joint."""
    return wheel(spec, side).joints[0]


def actuator(spec: Any, side: str) -> Any:
    """The actuator that drives the wheel."""
    target = joint(spec, side).name
    return next(item for item in spec.actuators if item.target == target)


def contact_geoms(body: Any) -> Iterator[Any]:
    """The geoms of a body that can touch something."""
    return (geom for geom in body.geoms if geom.contype or geom.conaffinity)


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass properties of a body, in its own frame.

    Attributes:
        mass: [kg].
        centre: centre of mass, shape ``(3,)`` [m].
        inertia: about that centre, along the body's axes, shape ``(3, 3)`` [kg m2].
    """

    mass: float
    centre: np.ndarray
    inertia: np.ndarray

    @classmethod
    def of(cls, spec: Any, body: Any) -> "Inertial":
        """As compiled, whether the model gives them or its geoms imply them."""
        import mujoco

        if _given(spec, body):
            inertia = _turned(body.inertia, body.iquat)
            return cls(float(body.mass), np.array(body.ipos), inertia)
        model = spec.copy().compile()
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body.name)
        inertia = _turned(model.body_inertia[index], model.body_iquat[index])
        return cls(float(model.body_mass[index]), model.body_ipos[index], inertia)

    def plus_point(self, mass: float, position: np.ndarray) -> "Inertial":
        """With a point mass [kg] added at `position` [m] (parallel-axis theorem)."""
        total = self.mass + mass
        centre = (self.mass * self.centre + mass * position) / total
        inertia = (
            self.inertia
            + _point(self.mass, self.centre - centre)
            + _point(mass, position - centre)
        )
        return Inertial(total, centre, inertia)

    def write(self, body: Any) -> None:
        """Into a body of an `MjSpec`, in place of what it had."""
        i = self.inertia
        body.explicitinertial = True
        body.mass = self.mass
        body.ipos = self.centre
        body.iquat = [1, 0, 0, 0]
        body.inertia = [0, 0, 0]  # the full matrix replaces it
        body.fullinertia = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]


def _given(spec: Any, body: Any) -> bool:
    """Whether a model gives a body's mass, main inertias and their axes, and has them
    taken as they are."""
    import mujoco

    alone = (
        spec.compiler.inertiafromgeom
        == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    )
    return bool(alone and body.explicitinertial and np.any(body.inertia))


def _turned(inertia: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Main inertias ``(3,)`` along axes that a quaternion turns, as a matrix."""
    import mujoco

    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array(quaternion, dtype=float))
    axes = rotation.reshape(3, 3)
    made: np.ndarray = axes @ np.diag(inertia) @ axes.T
    return made


def _point(mass: float, offset: np.ndarray) -> np.ndarray:
    return mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
