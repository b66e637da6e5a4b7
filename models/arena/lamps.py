"""Lamps to show on the arena's board, each with its safety boundary."""

from collections.abc import Sequence
from typing import Any

_BULB, _STEM, _FOOT = 0.022, 0.006, 0.045
"""m; radii of what is drawn of a lamp (assumed)"""

_RING = 0.0015  # m; half the height at which the boundary is drawn
_GLOW = (1.0, 0.78, 0.2, 1.0)
_METAL = (0.25, 0.26, 0.28, 1.0)
_WARN = (0.85, 0.37, 0.0, 1.0)
_PIECES = 48  # of the drawn boundary


def add(
    spec: Any, lamps: Sequence[tuple[float, float, float]], *, safety: float = 0.0
) -> None:
    """Draw lamps into a scene and let them shine; nothing can be touched.

    Adds for each lamp a site `lamp_<number>` where its light is, a bulb, a stem and a
    foot, a light for pictures, and the safety boundary around it.

    Args:
        spec: a `mujoco.MjSpec`; changed.
        lamps: where each source is, (x, y, height) [m].
        safety: radius of the safety boundary [m]; 0 = none is drawn.
    """
    for number, (x, y, height) in enumerate(lamps):
        _lamp(spec, number, x, y, height)
        if safety > 0:
            _boundary(spec, number, x, y, safety)


def _shown(spec: Any, **settings: Any) -> None:
    spec.worldbody.add_geom(contype=0, conaffinity=0, group=2, **settings)


def _lamp(spec: Any, number: int, x: float, y: float, height: float) -> None:
    import mujoco

    ball, tube = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CYLINDER
    glow = spec.add_material(name=f"glow_{number}", rgba=_GLOW, emission=0.35)
    spec.worldbody.add_site(name=f"lamp_{number}", pos=[x, y, height], group=4)
    _shown(
        spec, name=f"bulb_{number}", type=ball, size=[_BULB, 0, 0],
        pos=[x, y, height], material=glow.name,
    )  # fmt: skip
    stem = max((height - _BULB) / 2, 1e-3)
    _shown(
        spec, name=f"stem_{number}", type=tube, size=[_STEM, stem, 0],
        pos=[x, y, stem], rgba=_METAL,
    )  # fmt: skip
    _shown(
        spec, name=f"foot_{number}", type=tube, size=[_FOOT, 0.006, 0],
        pos=[x, y, 0.006], rgba=_METAL,
    )  # fmt: skip
    light = spec.worldbody.add_light(
        name=f"shine_{number}", pos=[x, y, height + 2 * _BULB], dir=[0, 0, -1]
    )
    light.type = mujoco.mjtLightType.mjLIGHT_POINT
    light.attenuation = [1, 0, 4.0]  # falls with the square; assumed for the eye
    light.diffuse, light.specular = [0.55, 0.5, 0.35], [0.1] * 3
    light.castshadow = False


def _boundary(spec: Any, number: int, x: float, y: float, radius: float) -> None:
    """A dashed circle on the floor."""
    import mujoco
    import numpy as np

    corners = np.linspace(0, 2 * np.pi, _PIECES + 1)
    for piece in range(0, _PIECES, 2):
        ends = [
            value
            for angle in corners[piece : piece + 2]
            for value in (x + radius * np.cos(angle), y + radius * np.sin(angle), _RING)
        ]
        _shown(
            spec, name=f"boundary_{number}_{piece}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[2 * _RING, 0, 0], fromto=ends,
            rgba=_WARN,
        )  # fmt: skip
