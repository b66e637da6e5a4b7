"""Mass properties of a body of a `mujoco.MjSpec`."""

from dataclasses import dataclass
from typing import Any

import numpy as np


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

    def plus(
        self, mass: float, position: np.ndarray, inertia: float = 0.0
    ) -> "Inertial":
        """With a mass [kg] added at `position` [m] (parallel-axis theorem), which has
        an inertia of its own about all axes [kg m2]; 0 = a point."""
        total = self.mass + mass
        centre = (self.mass * self.centre + mass * position) / total
        whole = (
            self.inertia
            + _point(self.mass, self.centre - centre)
            + _point(mass, position - centre)
            + inertia * np.eye(3)
        )
        return Inertial(total, centre, whole)

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
