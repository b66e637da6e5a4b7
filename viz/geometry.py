"""The geometry of a compiled MuJoCo model, logged into Rerun: one entity a body.

Rerun reads no MJCF. Each body becomes an entity with a pose; the shapes fixed to it
are one archetype per kind of geom on that entity. Differences of convention:
quaternions are wxyz in MuJoCo and xyzw in Rerun; a capsule is centred in MuJoCo and
runs from its translation along +z in Rerun; a plane has no thickness, and an endless
one gets an edge here.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from rerun import RecordingStream


VISIBLE_GROUPS = (0, 1, 2)
"""Geom groups that MuJoCo's own viewer shows by default."""

FLOOR = (176, 176, 170, 255)
"""Colour of planes whose look is a texture, which Rerun does not draw."""

ENDLESS = 3.0
"""m; half the edge of a plane that has none"""

_SHEET = 0.002
"""m; half the thickness at which a plane is drawn, below its surface"""


def entity(model: Any, body: int, root: str) -> str:
    """Entity path of a body: ``root/name``.

    Args:
        model: MuJoCo's.
        body: its number in the model.
        root: path under which the model's bodies are.
    """
    name = model.body(body).name or f"body_{body}"
    return f"{root}/{name.replace('/', '_')}"


def log_static(stream: "RecordingStream", model: Any, root: str = "world") -> None:
    """Log the shapes of every body; poses come with `send_poses`.

    Args:
        stream: a `rerun.RecordingStream`.
        model: a compiled `mujoco.MjModel`.
        root: entity path under which the bodies lie.
    """
    for body in range(model.nbody):
        parts = _shapes(model, body)
        if parts:
            stream.log(entity(model, body, root), *parts, static=True)


def body_poses(model: Any, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World pose of every body for every configuration.

    Args:
        model: a compiled `mujoco.MjModel`.
        qpos: configurations, ``(T, nq)``.

    Returns:
        positions ``(T, nbody, 3)`` [m] and quaternions ``(T, nbody, 4)`` xyzw.
    """
    import mujoco

    data = mujoco.MjData(model)
    positions = np.empty((len(qpos), model.nbody, 3))
    quaternions = np.empty((len(qpos), model.nbody, 4))
    for at, configuration in enumerate(qpos):
        data.qpos[:] = configuration
        mujoco.mj_kinematics(model, data)
        positions[at], quaternions[at] = data.xpos, xyzw(data.xquat)
    return positions, quaternions


def planar_qpos(model: Any, poses_world: np.ndarray) -> np.ndarray:
    """Configurations of a robot on a free joint that stands at planar poses.

    Height, tilt and all other joints are those of the first keyframe (or of the
    model, if it has none).

    Args:
        model: a compiled `mujoco.MjModel` whose first joint is free.
        poses_world: ``(T, 3)`` [m, m, rad].

    Returns:
        ``(T, nq)``.
    """
    home = model.key_qpos[0] if model.nkey else model.qpos0
    qpos = np.tile(home, (len(poses_world), 1))
    at = free_joint(model)
    qpos[:, at : at + 2] = poses_world[:, :2]
    half = poses_world[:, 2] / 2
    zero = np.zeros_like(half)
    qpos[:, at + 3 : at + 7] = np.stack([np.cos(half), zero, zero, np.sin(half)], 1)
    return qpos


def send_poses(
    stream: "RecordingStream",
    model: Any,
    times: Sequence,
    qpos: np.ndarray,
    *,
    root: str = "world",
) -> None:
    """Log the poses of all moving bodies as columns.

    Args:
        stream: a `rerun.RecordingStream`.
        model: a compiled `mujoco.MjModel`.
        times: the `rerun.TimeColumn`s of the T rows.
        qpos: configurations, ``(T, nq)``.
        root: as given to `log_static`.
    """
    import rerun as rr

    positions, quaternions = body_poses(model, qpos)
    for body in range(1, model.nbody):
        columns = rr.Transform3D.columns(
            translation=positions[:, body], quaternion=quaternions[:, body]
        )
        stream.send_columns(entity(model, body, root), times, columns)


def xyzw(quaternion: np.ndarray) -> np.ndarray:
    """MuJoCo's wxyz as Rerun's xyzw, along the last axis.

    Args:
        quaternion: ``(..., 4)``, the real part first.

    Returns:
        ``(..., 4)``, the real part last.
    """
    return np.roll(quaternion, -1, axis=-1)


def free_joint(model: Any) -> int:
    """Where the first free joint begins in `qpos`; 0 without one."""
    import mujoco

    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    return int(model.jnt_qposadr[free[0]]) if len(free) else 0


def _shapes(model: Any, body: int) -> list:
    """The archetypes that show one body's geoms."""
    import mujoco

    first = model.body_geomadr[body]
    geoms = [
        geom
        for geom in range(first, first + model.body_geomnum[body])
        if model.geom_group[geom] in VISIBLE_GROUPS and _colour(model, geom)[3] > 0
    ]
    kind = mujoco.mjtGeom
    makers = {
        kind.mjGEOM_BOX: _boxes,
        kind.mjGEOM_PLANE: _boxes,
        kind.mjGEOM_CYLINDER: _cylinders,
        kind.mjGEOM_CAPSULE: _capsules,
        kind.mjGEOM_SPHERE: _ellipsoids,
        kind.mjGEOM_ELLIPSOID: _ellipsoids,
        kind.mjGEOM_MESH: _meshes,
    }
    grouped: dict = {}
    for geom in geoms:
        maker = makers.get(kind(model.geom_type[geom]))
        if maker:
            grouped.setdefault(maker, []).append(geom)
    return [maker(model, members) for maker, members in grouped.items()]


def _colour(model: Any, geom: int) -> np.ndarray:
    """RGBA bytes of a geom: its own, or its material's."""
    material = model.geom_matid[geom]
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    textured = material >= 0 and (model.mat_texid[material] >= 0).any()
    if textured and np.allclose(rgba[:3], 1.0):
        return np.array(FLOOR)
    return np.round(np.clip(rgba, 0, 1) * 255).astype(int)


def _placed(model: Any, geoms: list[int]) -> dict:
    """Pose and colour of geoms in their body, as archetype arguments."""
    import rerun as rr

    return {
        "quaternions": xyzw(model.geom_quat[geoms]),
        "colors": [_colour(model, geom) for geom in geoms],
        "fill_mode": rr.components.FillMode.Solid,
    }


def _boxes(model: Any, geoms: list[int]) -> Any:
    """Boxes, and planes as thin boxes under their surface."""
    import mujoco
    import rerun as rr

    sizes, centres = model.geom_size[geoms].copy(), model.geom_pos[geoms].copy()
    for at, geom in enumerate(geoms):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
            edges = np.where(sizes[at, :2] > 0, sizes[at, :2], ENDLESS)
            sizes[at] = *edges, _SHEET
            centres[at] -= _axis_z(model, geom) * _SHEET
    return rr.Boxes3D(centers=centres, half_sizes=sizes, **_placed(model, geoms))


def _cylinders(model: Any, geoms: list[int]) -> Any:
    import rerun as rr

    return rr.Cylinders3D(
        centers=model.geom_pos[geoms],
        radii=model.geom_size[geoms, 0],
        lengths=2 * model.geom_size[geoms, 1],
        **_placed(model, geoms),
    )


def _capsules(model: Any, geoms: list[int]) -> Any:
    import rerun as rr

    half = model.geom_size[geoms, 1]
    axes = np.array([_axis_z(model, geom) for geom in geoms])
    return rr.Capsules3D(
        translations=model.geom_pos[geoms] - axes * half[:, None],
        radii=model.geom_size[geoms, 0],
        lengths=2 * half,
        **_placed(model, geoms),
    )


def _ellipsoids(model: Any, geoms: list[int]) -> Any:
    """Spheres and ellipsoids."""
    import mujoco
    import rerun as rr

    sizes = model.geom_size[geoms].copy()
    sphere = model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_SPHERE
    sizes[sphere] = sizes[sphere, :1]
    return rr.Ellipsoids3D(
        centers=model.geom_pos[geoms], half_sizes=sizes, **_placed(model, geoms)
    )


def _meshes(model: Any, geoms: list[int]) -> Any:
    """All meshes of a body as one, coloured by vertex."""
    import rerun as rr

    corners, faces, colours, count = [], [], [], 0
    for geom in geoms:
        mesh = model.geom_dataid[geom]
        first, size = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        start, faces_n = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        local = model.mesh_vert[first : first + size]
        corners.append(local @ _rotation(model, geom).T + model.geom_pos[geom])
        faces.append(model.mesh_face[start : start + faces_n] + count)
        colours.append(np.tile(_colour(model, geom), (size, 1)))
        count += size
    return rr.Mesh3D(
        vertex_positions=np.concatenate(corners),
        triangle_indices=np.concatenate(faces),
        vertex_colors=np.concatenate(colours),
    )


def _rotation(model: Any, geom: int) -> np.ndarray:
    import mujoco

    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, model.geom_quat[geom])
    return matrix.reshape(3, 3)


def _axis_z(model: Any, geom: int) -> np.ndarray:
    return _rotation(model, geom)[:, 2]
