"""A user's MJCF as the diagnosis needs it: actuators named, loops closed, and lean.

A fit compiles a model hundreds of times. Textures and meshes that only draw it are most
of that time, and of the memory that compiled models take; what a body weighs is worked
out from its geoms each time anew.
"""

import warnings
from collections.abc import Iterable, Sequence

import mujoco
import numpy as np

from bns.errors import BnsError, UnknownNameError
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.described import Told
from bns.models import mjcf as mjcf_file


def spec(config: OwnConfig) -> mujoco.MjSpec:
    """The model of a description.

    Actuators without a name are called as their joint (or tendon, site, body) is.
    Where the description gives the gains of a position loop, the actuator becomes one
    (what it did before is dropped), or is added to the joint of that name; loops that
    the model's step is too long for are integrated implicitly. Bodies that
    it says are held are fixed where they are, and touch no ground.

    Raises:
        BnsError: a loop on what is no joint, or a body held that is on no free joint.
        ValueError: MuJoCo refuses the file.
    """
    made = mjcf_file.load(config.model)
    name_actuators(made)
    for told in config.told:
        if told.kp:
            _close(made, told)
    damped = [told for told in config.told if told.kd]
    if damped or config.held:
        model = made.compile()
        _steady(made, model, damped)
        _hold(made, model, config.held)
    return made


def driven(model: mujoco.MjModel, actuator: int) -> int:
    """Number of the joint that an actuator drives, -1 = none."""
    kinds = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    on_joint = int(model.actuator_trntype[actuator]) in map(int, kinds)
    return int(model.actuator_trnid[actuator, 0]) if on_joint else -1


def hinged(model: mujoco.MjModel, joint: int) -> bool:
    """Whether a joint is a hinge or a slide."""
    kinds = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
    return int(model.jnt_type[joint]) in map(int, kinds)


def loose(model: mujoco.MjModel) -> list[str]:
    """Names of the bodies on free joints that carry joints which are driven."""
    joints = (driven(model, actuator) for actuator in range(model.nu))
    bodies = (model.jnt_bodyid[joint] for joint in joints if joint >= 0)
    roots = sorted({int(model.body_rootid[body]) for body in bodies})
    names = [model.body(root).name for root in roots if free_joint(model, root) >= 0]
    return [name for name in names if name]


def grounded(model: mujoco.MjModel) -> bool:
    """Whether there is anything fixed that a robot could stand on."""
    fixed = model.body_weldid[model.geom_bodyid] == 0
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return bool((fixed & solid).any())


def free_joint(model: mujoco.MjModel, body: int) -> int:
    """Number of a body's free joint, -1 = none."""
    first = int(model.body_jntadr[body])
    free = first >= 0 and model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE
    return first if free else -1


def _hold(made: mujoco.MjSpec, model: mujoco.MjModel, names: Sequence[str]) -> None:
    """Fix bodies where they are; poses of the other joints stay as they are.

    Args:
        made: the spec; written to.
        model: that it compiles to, with these bodies free.
        names: of the bodies.
    """
    if not names:
        return
    joints = {name: free_joint(model, number(model, "body", name)) for name in names}
    for name, joint in joints.items():
        if joint < 0:
            raise BnsError(f"held = {name!r}: this body is on no free joint.")
    at = [int(model.jnt_qposadr[joint]) for joint in joints.values()]
    moved = [int(model.jnt_dofadr[joint]) for joint in joints.values()]
    for name in names:
        body = made.body(name)
        for item in body.joints:
            made.delete(item)
    for key in made.keys:
        for numbers, first, count in (("qpos", at, 7), ("qvel", moved, 6)):
            values = np.array(list(getattr(key, numbers)))
            if len(values):
                gone = np.add.outer(first, np.arange(count)).ravel()
                setattr(key, numbers, np.delete(values, gone))
    for geom in made.worldbody.geoms:
        if geom.type in GROUND:
            geom.contype = geom.conaffinity = 0
    _excluded(made, model, [number(model, "body", name) for name in names])


def _excluded(made: mujoco.MjSpec, model: mujoco.MjModel, held: Sequence[int]) -> None:
    """Exclude contacts of held bodies with those that joints join to them, which MuJoCo
    takes for contacts with the world once their parent is fixed.

    Args:
        made: the spec; written to.
        model: with these bodies free.
        held: numbers of the bodies.
    """
    welded, solid = model.body_weldid, np.unique(model.geom_bodyid)
    parents = welded[model.body_parentid[welded]]
    bodies = {body.id: body for body in made.bodies}
    for one in solid[np.isin(welded[solid], held)]:
        joined = (parents[solid] == welded[one]) & (welded[solid] != welded[one])
        for other in solid[joined]:
            ends = [bodies[int(one)], bodies[int(other)]]
            for body in ends:
                body.name = body.name or f"body_{body.id}"
            made.add_exclude(bodyname1=ends[0].name, bodyname2=ends[1].name)


def name_actuators(made: mujoco.MjSpec) -> list[str]:
    """Give actuators without a name that of what they act on; gives the new names."""
    taken = {actuator.name for actuator in made.actuators}
    new = []
    for actuator in made.actuators:
        if not actuator.name and actuator.target:
            name = actuator.target
            number = 1
            while name in taken:
                number += 1
                name = f"{actuator.target}_{number}"
            actuator.name = name
            taken.add(name)
            new.append(name)
    return new


def _close(made: mujoco.MjSpec, told: Told) -> None:
    actuator = made.actuator(told.actuator)
    gear = 1.0
    if actuator is None:
        _joint(made, told.actuator, told)
        actuator = made.add_actuator(name=told.actuator, target=told.actuator)
        actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
        actuator.gear = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    else:
        _joint(made, actuator.target, told)
        gear = float(actuator.gear[0])
        actuator.gear = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    limit = min(told.torque, largest(actuator, gear))
    actuator.dyntype = mujoco.mjtDyn.mjDYN_NONE
    actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    actuator.gainprm = _padded([told.kp], len(actuator.gainprm))
    actuator.biasprm = _padded([0.0, -told.kp, -told.kd], len(actuator.biasprm))
    actuator.ctrllimited = False
    if np.isfinite(limit):
        actuator.forcelimited = True
        actuator.forcerange = [-limit, limit]


def _steady(made: mujoco.MjSpec, model: mujoco.MjModel, damped: Sequence[Told]) -> None:
    """Integrate implicitly, if Euler's method would make a loop's damping unstable: it
    is taken for the whole step, in which the loop turns a light joint round.

    Args:
        made: the spec; written to.
        model: that it compiles to.
        damped: commands of loops with damping.
    """
    joints = [driven(model, model.actuator(told.actuator).id) for told in damped]
    inertia = model.dof_M0[model.jnt_dofadr[joints]]
    taken = np.array([told.kd for told in damped]) * model.opt.timestep
    euler = made.option.integrator == mujoco.mjtIntegrator.mjINT_EULER
    if euler and (taken > STIFF * inertia).any():
        made.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST


def largest(actuator: mujoco.MjsActuator, gear: float) -> float:
    """Largest torque of a motor by its limits of control and force; infinity = any."""
    found = [np.inf]
    automatic = mujoco.mjtLimited.mjLIMITED_AUTO
    for limited, span, factor in (
        (actuator.ctrllimited, actuator.ctrlrange, float(actuator.gainprm[0])),
        (actuator.forcelimited, actuator.forcerange, 1.0),
    ):
        given = span[0] < span[1]
        if given and (
            limited == mujoco.mjtLimited.mjLIMITED_TRUE or limited == automatic
        ):
            found.append(abs(gear * factor) * float(np.abs(span).max()))
    return min(found)


def _joint(made: mujoco.MjSpec, name: str, told: Told) -> None:
    if made.joint(name) is None:
        known = ", ".join(joint.name for joint in made.joints if joint.name)
        raise BnsError(
            f"The loop of {told.channel.name!r} needs a joint, {name!r} is none; the "
            f"model has {known}."
        )


def _padded(values: Sequence[float], count: int) -> list[float]:
    return [*values, *[0.0] * (count - len(values))]


STIFF = 0.5  # of its speed that a loop may take from a joint in one step of Euler's
GROUND = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
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


def posed(model: mujoco.MjModel, pose: str, settle: float) -> mujoco.MjData:
    """A model that has settled in a pose.

    Args:
        model: that is recorded.
        pose: name of the keyframe; "" = the model's own.
        settle: for how long [s].
    """
    data = mujoco.MjData(model)
    if pose:
        mujoco.mj_resetDataKeyframe(model, data, number(model, "key", pose))
    for _ in range(round(settle / model.opt.timestep)):
        mujoco.mj_step(model, data)
    data.time = 0.0
    return data


def number(model: mujoco.MjModel, kind: str, name: str) -> int:
    """The number of a part of a model.

    Args:
        model: compiled.
        kind: "joint", "site", "body", "tendon", "actuator" or "key".
        name: of the part.

    Raises:
        UnknownNameError: the model has no such part.
    """
    try:
        return int(getattr(model, kind)(name).id)
    except KeyError:
        count = {
            "joint": model.njnt,
            "site": model.nsite,
            "body": model.nbody,
            "tendon": model.ntendon,
            "actuator": model.nu,
            "key": model.nkey,
        }[kind]
        known = [getattr(model, kind)(at).name for at in range(count)]
        raise UnknownNameError(f"{kind} of the model", name, known) from None
