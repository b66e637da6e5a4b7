"""A body's mass as an explanation: what is added, and where it sits.

A load seldom sits at a link's centre of mass, and a link that is heavier than its model
is so somewhere. The explanation has the mass and its three moments about the centre of
mass of the model: numbers in which motion is linear while they are small.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from bns.gap.decomposition.row import Row
from bns.gap.models.mjcf import effects
from bns.worlds.effects.base import Effect

AXES = "xyz"
PLAUSIBLE = 0.1  # of a body's mass (assumed)
SLACK = 0.004  # of a body's mass: how well a model knows it, and its centre (assumed)
FAR = 4.0  # radii of gyration from the centre: the farthest
TAKEN = 0.5  # of its spread that a mass taken off may take along


@dataclass(frozen=True)
class Body:
    """What a model says of a body.

    Attributes:
        mass: [kg].
        gyration: largest radius of gyration [m] about its centre of mass, with all that
            is fixed to it: a load may sit there.
        spread: least second moment of the mass about its centre [kg m2].
        whole: mass with all that is fixed to it [kg].
    """

    mass: float
    gyration: float
    spread: float
    whole: float

    @classmethod
    def of(cls, model: mujoco.MjModel, name: str) -> "Body":
        """As compiled."""
        at = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        mass = max(float(model.body_mass[at]), 1e-9)
        inertia = model.body_inertia[at]
        spread = max(float(inertia.sum() / 2 - inertia.max()), 0.0)
        fixed = np.arange(model.nbody) == at
        if model.body_weldid[at]:
            fixed |= model.body_weldid == model.body_weldid[at]
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        away = np.linalg.norm(data.xipos[fixed] - data.xipos[at], axis=1)
        masses = model.body_mass[fixed]
        turned = float((model.body_inertia[fixed].max(axis=1) + masses * away**2).sum())
        whole = max(float(masses.sum()), mass)
        return cls(mass, float(np.sqrt(turned / whole)), spread, whole)


def rows(item: Row, body: Body, excite: str) -> list[Row]:
    """The mass and its moments, one explanation.

    Args:
        item: the candidate of the mass.
        body: that it is of.
        excite: which commands make it felt.
    """
    sd, slack = PLAUSIBLE * body.whole, item.slack or SLACK * body.whole
    part = item.fixed["part"]
    shared: dict[str, Any] = {
        "group": item.name,
        "covers": tuple(_centre(part, axis) for axis in AXES),
        "excite": excite,
    }
    made = [
        Row(item.name, 0.0, sd, item.low, item.high, unit=item.unit, slack=slack,
            **shared)
    ]  # fmt: skip
    if body.gyration:
        far = FAR * item.high * body.gyration
        made += [
            Row(f"{item.name}.m{axis}", 0.0, sd * body.gyration, -far, far,
                unit="kg m", slack=slack * body.gyration, **shared)
            for axis in AXES
        ]  # fmt: skip
    return made


def centre(part: str, body: Body, excite: str) -> list[Row]:
    """The centre of mass that a mass covers, an explanation along each axis.

    Args:
        part: name of the body.
        body: that.
        excite: which commands make it felt.
    """
    size = body.gyration
    return [
        Row(
            _centre(part, axis), 0.0, PLAUSIBLE * size, -FAR * size, FAR * size,
            unit="m", slack=SLACK * size, later=True, excite=excite,
            effect="body_centre", parameter=f"d{axis}", fixed={"part": part},
        )
        for axis in AXES
        if size
    ]  # fmt: skip


def _centre(part: str, axis: str) -> str:
    return f"body_centre.d{axis}[{part}]"


def centred(
    name: str, values: Mapping[str, float], part: str, body: Body
) -> dict[str, float]:
    """Values of the centre of mass that do nearly what a mass and its moments do.

    Args:
        name: of the explanation.
        values: of its rows.
        part: name of the body.
        body: that.
    """
    away = _moments(name, values) / body.mass
    return {_centre(part, axis): float(x) for axis, x in zip(AXES, away, strict=True)}


def changes(
    name: str, values: Mapping[str, float], part: str, body: Body
) -> list[Effect]:
    """The effects that an explanation is simulated by.

    The mass sits where its moments say, or as far out as it may; what moments are left
    shift the centre of mass, so that they have a slope at any mass and at none.

    Args:
        name: of the explanation.
        values: of its rows that are not nominal.
        part: name of the body.
        body: that.
    """
    mass, away, left = _placed(name, values, body)
    made = []
    if mass:
        made.append(effects.make("body_mass", _load(part, mass, away)))
    if left.any():
        shift = left / (body.mass + mass)
        made.append(effects.make("body_centre", {"part": part, **_place(shift)}))
    return made


def added(name: str, values: Mapping[str, float], part: str, body: Body) -> Effect:
    """The mass where its moments say, or as far out as it may.

    Args:
        name: of the explanation.
        values: of its rows.
        part: name of the body.
        body: that.
    """
    mass, away, _ = _placed(name, values, body)
    return effects.make("body_mass", _load(part, mass, away))


def _placed(
    name: str, values: Mapping[str, float], body: Body
) -> tuple[float, np.ndarray, np.ndarray]:
    """The mass [kg], its place ``(3,)`` [m] from the centre of mass, and the moments
    ``(3,)`` [kg m] that it does not have there."""
    mass = max(values.get(name, 0.0), -0.9 * body.mass)
    moments = _moments(name, values)
    if not mass:
        return mass, np.zeros(3), moments
    limit = FAR * body.gyration
    if mass < 0:  # what is left has a spread
        reduced = body.mass * -mass / (body.mass + mass)
        limit = min(limit, float(np.sqrt(TAKEN * body.spread / reduced)))
    away = moments / mass
    away = away * min(1.0, limit / max(float(np.linalg.norm(away)), 1e-12))
    return mass, away, moments - mass * away


def _moments(name: str, values: Mapping[str, float]) -> np.ndarray:
    return np.array([values.get(f"{name}.m{axis}", 0.0) for axis in AXES])


def _load(part: str, mass: float, away: np.ndarray) -> dict[str, Any]:
    return {"part": part, "added": mass, **_place(away)}


def _place(away: np.ndarray) -> dict[str, float]:
    return {f"d{axis}": float(x) for axis, x in zip(AXES, away, strict=True)}
