"""What ties joints to each other, tendons and equalities, and places to joints."""

from collections.abc import Collection, Iterable

import mujoco
import numpy as np

from bns.gap.models.mjcf.described import AXES


def tied(model: mujoco.MjModel, roots: Collection[int]) -> set[int]:
    """Bodies on the world whose trees are tied to some by equalities or tendons, and
    these.

    Args:
        model: that is recorded.
        roots: numbers of bodies on the world, see `MjModel.body_rootid`.
    """
    groups = [*_by_equality(model), *by_tendon(model)]
    sets = [
        {int(model.body_rootid[body]) for body in bodies} - {0} for bodies in groups
    ]
    found, count = set(roots), 0
    while len(found) > count:
        count = len(found)
        for group in sets:
            found |= group if group & found else set()
    return found


def _by_equality(model: mujoco.MjModel) -> Iterable[list[int]]:
    """Numbers of the bodies that each equality ties."""
    for number, kind in enumerate(model.eq_type):
        if kind == mujoco.mjtEq.mjEQ_JOINT:
            owner = model.jnt_bodyid
        elif model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
            owner = model.site_bodyid
        elif model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_BODY:
            owner = np.arange(model.nbody)
        else:  # of tendons, which tie by themselves
            continue
        ends = (model.eq_obj1id[number], model.eq_obj2id[number])
        yield [int(owner[end]) for end in ends if end >= 0]


def by_tendon(model: mujoco.MjModel) -> list[list[int]]:
    """Numbers of the bodies that each tendon runs over."""
    owners = {
        mujoco.mjtWrap.mjWRAP_JOINT: model.jnt_bodyid,
        mujoco.mjtWrap.mjWRAP_SITE: model.site_bodyid,
    }
    found = []
    for first, count in zip(model.tendon_adr, model.tendon_num, strict=True):
        bodies = []
        for place in range(first, first + count):
            owner = owners.get(mujoco.mjtWrap(int(model.wrap_type[place])))
            if owner is not None:
                bodies.append(int(owner[model.wrap_objid[place]]))
        found.append(bodies)
    return found


def wound(model: mujoco.MjModel, tendon: int) -> list[str]:
    """Names of the joints that a fixed tendon pulls; none for other tendons."""
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    wraps = range(first, first + count)
    if any(int(model.wrap_type[w]) != int(mujoco.mjtWrap.mjWRAP_JOINT) for w in wraps):
        return []
    return [model.joint(int(model.wrap_objid[w])).name for w in wraps]


def arms(model: mujoco.MjModel, fewest: int = 1) -> list[str]:
    """Lever arms of the fixed tendons, ``TENDON/JOINT``.

    Args:
        model: that is recorded.
        fewest: joints of a tendon that counts.
    """
    found = []
    for tendon in range(model.ntendon):
        name, joints = model.tendon(tendon).name, wound(model, tendon)
        if name and len(joints) >= fewest:
            found += [f"{name}/{joint}" for joint in joints if joint]
    return found


def slides(model: mujoco.MjModel) -> dict[tuple[str, str], str]:
    """Slides that put a body on the world where its place says: by body and axis the
    joint whose position that place is, as of a swimmer in a plane."""
    found = {}
    for body in np.flatnonzero(model.body_parentid == 0)[1:]:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        held = range(first, first + count)
        turned = not np.allclose(model.body_quat[body], [1.0, 0.0, 0.0, 0.0])
        if turned or any(np.any(model.jnt_pos[joint]) for joint in held):
            continue
        for joint in held:
            if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_SLIDE:
                break  # what comes behind it turns with it
            way = int(np.argmax(model.jnt_axis[joint]))
            straight = np.isclose(model.jnt_axis[joint, way], 1.0)
            if straight and not model.body_pos[body, way]:
                name = model.joint(joint).name
                found[model.body(int(body)).name, AXES[way]] = name
    return {place: joint for place, joint in found.items() if all(place) and joint}


def followers(model: mujoco.MjModel) -> list[str]:
    """Names of the joints that follow another one by an equality."""
    return [
        name
        for first, second, kind in zip(
            model.eq_obj1id, model.eq_obj2id, model.eq_type, strict=True
        )
        if kind == mujoco.mjtEq.mjEQ_JOINT
        and second >= 0
        and (name := model.joint(int(first)).name)
    ]
