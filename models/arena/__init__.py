"""The arena: a white board under an overhead camera, with objectives to show."""

from collections.abc import Mapping, Sequence
from typing import Any

SIZE = (2.7, 1.8)
"""m; area that the camera tracks, along x and y (thesis 4.2.6); its centre is the
origin"""

RADIUS = 0.09
"""m; within it an objective counts as reached (thesis, Algorithm 5)"""

CAMERA_HEIGHT = 2.4
"""m; of the overhead camera above the board (assumed: a ceiling)"""

_RIM = 0.015  # m; width of the frame drawn around the board (assumed)
_DISC = 0.0004  # m; half the height at which an objective is drawn
_BOARD = (0.95, 0.95, 0.94, 1.0)
_GROUND = (0.47, 0.49, 0.52, 1.0)
_FRAME = (0.30, 0.31, 0.33, 1.0)
_REACH = (0.99, 0.83, 0.35, 1.0)
_INK = (0.13, 0.15, 0.20, 1.0)

# Letters as strokes in a box from (-1, -1) to (1, 1).
_STROKES: dict[str, Sequence[Sequence[float]]] = {
    "A": [(-0.8, -1, 0, 1), (0, 1, 0.8, -1), (-0.45, -0.25, 0.45, -0.25)],
    "B": [
        (-0.7, -1, -0.7, 1),
        (-0.7, 1, 0.4, 1),
        (0.4, 1, 0.6, 0.5),
        (0.6, 0.5, 0.3, 0.05),
        (-0.7, 0.05, 0.3, 0.05),
        (0.3, 0.05, 0.7, -0.5),
        (0.7, -0.5, 0.4, -1),
        (0.4, -1, -0.7, -1),
    ],
    "C": [
        (0.7, 0.75, 0.2, 1),
        (0.2, 1, -0.35, 0.9),
        (-0.35, 0.9, -0.7, 0.4),
        (-0.7, 0.4, -0.7, -0.4),
        (-0.7, -0.4, -0.35, -0.9),
        (-0.35, -0.9, 0.2, -1),
        (0.2, -1, 0.7, -0.75),
    ],
    "D": [
        (-0.7, -1, -0.7, 1),
        (-0.7, 1, 0.2, 1),
        (0.2, 1, 0.7, 0.45),
        (0.7, 0.45, 0.7, -0.45),
        (0.7, -0.45, 0.2, -1),
        (0.2, -1, -0.7, -1),
    ],
    "E": [
        (-0.6, -1, -0.6, 1),
        (-0.6, 1, 0.7, 1),
        (-0.6, 0, 0.5, 0),
        (-0.6, -1, 0.7, -1),
    ],
}


def spec(
    objectives: Mapping[str, tuple[float, float]] | None = None,
    *,
    radius: float = RADIUS,
) -> Any:
    """The arena without a robot, as a `mujoco.MjSpec`.

    Args:
        objectives: places to show [m], by name.
        radius: of their discs [m].
    """
    import mujoco

    made = mujoco.MjSpec()
    made.modelname = "arena"
    furnish(made, objectives=objectives or {}, radius=radius)
    return made


def furnish(
    spec: Any,
    *,
    objectives: Mapping[str, tuple[float, float]],
    radius: float = RADIUS,
    visuals: bool = True,
) -> None:
    """Put a robot that has no floor yet on the board.

    Adds the geom `floor` (an endless plane: leaving the board is no fall) and, for
    each objective, a site `objective_<name>`. Nothing else that it adds can be touched.

    Args:
        spec: a `mujoco.MjSpec`; changed.
        objectives: places to show [m], by name.
        radius: of their discs [m].
        visuals: with lights, cameras and what only shows.
    """
    import mujoco

    floor = spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[*_half(), 0.05]
    )
    floor.contype, floor.conaffinity, floor.rgba = 0, 1, _BOARD
    for name, (x, y) in objectives.items():
        spec.worldbody.add_site(name=f"objective_{name}", pos=[x, y, 0], group=4)
    if not visuals:
        return
    _light(spec)
    _cameras(spec)
    _surround(spec)
    for name, (x, y) in objectives.items():
        _objective(spec, name, x, y, radius)


def _half() -> tuple[float, float]:
    return SIZE[0] / 2, SIZE[1] / 2


def _shown(spec: Any, **settings: Any) -> None:
    """Add a geom to the world that only shows."""
    spec.worldbody.add_geom(contype=0, conaffinity=0, group=2, **settings)


def _light(spec: Any) -> None:
    import mujoco

    light = spec.worldbody.add_light(
        name="lamp", pos=[0.4, -0.6, 2.6], dir=[-0.15, 0.23, -1]
    )
    light.type = mujoco.mjtLightType.mjLIGHT_SPOT
    light.cutoff, light.exponent = 80, 0
    light.attenuation = [1, 0, 0]
    light.diffuse, light.specular = [0.38] * 3, [0.1] * 3
    head = spec.visual.headlight
    head.ambient, head.diffuse, head.specular = [0.42] * 3, [0.2] * 3, [0.0] * 3
    spec.stat.center, spec.stat.extent = [0, 0, 0], 1.6
    spec.visual.map.znear, spec.visual.map.zfar = 0.05, 6
    quality = spec.visual.quality
    quality.shadowsize, quality.numslices, quality.numstacks = 4096, 72, 32
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1280


def _cameras(spec: Any) -> None:
    """`overhead` sees the whole board, `perspective` looks across it."""
    import mujoco
    import numpy as np

    half_height = _half()[1] * 1.06  # a margin of 6 %
    fovy = np.degrees(2 * np.arctan(half_height / CAMERA_HEIGHT))
    spec.worldbody.add_camera(name="overhead", pos=[0, 0, CAMERA_HEIGHT], fovy=fovy)
    camera = spec.worldbody.add_camera(name="perspective", pos=[1.05, -2.25, 1.55])
    camera.fovy = 45
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = [0.906, 0.423, 0, -0.249, 0.534, 0.808]


def _surround(spec: Any) -> None:
    """A frame around the board and the ground that it lies on."""
    import mujoco

    box, (x, y) = mujoco.mjtGeom.mjGEOM_BOX, _half()
    _shown(
        spec, name="ground", type=box, size=[6, 6, 0.01], pos=[0, 0, -0.03],
        rgba=_GROUND,
    )  # fmt: skip
    for side, place, size in (
        ("right", [x + _RIM, 0], [_RIM, y + 2 * _RIM]),
        ("left", [-x - _RIM, 0], [_RIM, y + 2 * _RIM]),
        ("top", [0, y + _RIM], [x, _RIM]),
        ("bottom", [0, -y - _RIM], [x, _RIM]),
    ):
        _shown(
            spec, name=f"frame_{side}", type=box, size=[*size, 0.01],
            pos=[*place, -0.009], rgba=_FRAME,
        )  # fmt: skip


def _objective(spec: Any, name: str, x: float, y: float, radius: float) -> None:
    """A disc of the radius within which it counts as reached, and its letter."""
    import mujoco

    _shown(
        spec, name=f"disc_{name}", type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[radius, _DISC, 0], pos=[x, y, 0], rgba=_REACH,
    )  # fmt: skip
    scale = 0.38 * radius
    for index, stroke in enumerate(_STROKES.get(name, [])):
        ends = [x + scale * stroke[0], y + scale * stroke[1], _DISC]
        ends += [x + scale * stroke[2], y + scale * stroke[3], _DISC]
        _shown(
            spec, name=f"letter_{name}_{index}", type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[0.09 * scale, 0, 0], fromto=ends, rgba=_INK,
        )  # fmt: skip


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
