"""A user's MJCF without what no simulation needs: compiled in a fraction of the time.

A fit compiles a model hundreds of times. Textures and meshes that only draw it are most
of that time, and of the memory that compiled models take; what a body weighs is worked
out from its geoms each time anew.
"""

import warnings
from collections.abc import Iterable

import mujoco
import numpy as np

CLOSE = 1e-9  # by which inertias may differ, of their size
KINDS = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)


def weighed(made: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Write into a spec what its bodies weigh, so that it need not be worked out.

    Args:
        made: the spec; written to.
        model: that it compiles to.
    """
    for body in made.bodies:
        number = body.id
        if not number:
            continue
        body.explicitinertial = True
        body.mass = float(model.body_mass[number])
        body.ipos = model.body_ipos[number]
        body.iquat = model.body_iquat[number]
        body.inertia = model.body_inertia[number]
        body.fullinertia = np.full(6, np.nan)
    made.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    made.compiler.settotalmass = -1.0
    made.compiler.balanceinertia = False
    made.compiler.boundmass = made.compiler.boundinertia = 0.0


def lean(made: mujoco.MjSpec) -> mujoco.MjSpec:
    """A copy of a spec without what only draws it; the spec itself where a copy would
    move otherwise.

    Args:
        made: a spec that compiles.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they were told when the file was read
        copy = made.copy()
        whole = copy.compile()  # which numbers its bodies
        try:
            weighed(copy, whole)
            _undrawn(copy)
            model = copy.compile()
        except (ValueError, mujoco.FatalError):
            return made
    return copy if _alike(model, whole) else made


def _undrawn(made: mujoco.MjSpec) -> None:
    for item in (*made.geoms, *made.sites, *made.tendons, *made.meshes):
        if getattr(item, "material", ""):
            item.material = ""
    named = _named(made)
    for geom in made.geoms:
        drawn = not geom.contype and not geom.conaffinity and not geom.fluid_ellipsoid
        if geom.type in KINDS and drawn and geom.name not in named:
            made.delete(geom)
    used = {geom.meshname for geom in made.geoms}
    unused = [mesh for mesh in made.meshes if mesh.name not in used]
    for item in (*made.skins, *made.materials, *made.textures, *unused):
        made.delete(item)


def _named(made: mujoco.MjSpec) -> set[str]:
    """Names of geoms that other parts may refer to: none of these is dropped."""
    names: set[str] = set()
    for pair in made.pairs:
        names |= {pair.geomname1, pair.geomname2}
    for sensor in made.sensors:
        names |= {sensor.objname, sensor.refname}
    return (names | _wrapped(made.tendons)) - {""}


def _wrapped(tendons: Iterable[mujoco.MjsTendon]) -> set[str]:
    return {
        wrap.target.name
        for tendon in tendons
        for wrap in tendon.path
        if getattr(wrap, "target", None) is not None
    }


def _alike(model: mujoco.MjModel, whole: mujoco.MjModel) -> bool:
    """Whether two models move alike: as many parts, and as heavy."""
    sizes = ("nq", "nv", "nu", "na", "nbody", "nsite", "nkey", "neq", "ntendon")
    if any(getattr(model, size) != getattr(whole, size) for size in sizes):
        return False
    fields = ("body_mass", "body_inertia", "body_ipos", "dof_M0", "qpos0")
    return all(
        np.allclose(
            getattr(model, name),
            getattr(whole, name),
            rtol=CLOSE,
            atol=CLOSE * float(np.abs(getattr(whole, name)).max(initial=1e-9)),
        )
        for name in fields
    )
