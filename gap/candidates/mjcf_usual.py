"""What is considered of a user's own model where the user does not say what."""

from collections.abc import Iterable, Mapping, Sequence

import mujoco
import numpy as np

from bns.gap.models.mjcf import effects, prepared, ties, view
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.described import PLACES, Seen
from bns.worlds.effects.parts import ALL, FILTERS, ROUND_GEOMS

SHORT = 1e-6  # [m] no length
USUAL = (
    "joint_damping",
    "joint_friction",
    "joint_armature",
    "joint_stiffness",
    "joint_stop",
    "joint_bumper",
    "tendon_damping",
    "tendon_friction",
    "tendon_stiffness",
    "tendon_slack",
    "tendon_arm",
    "coupling_ratio",
    "body_mass",
    "body_tilt",
    "gravity_compensation",
    "actuator_gain",
    "actuator_gear",
    "actuator_kp",
    "actuator_kd",
    "actuator_lag",
    "actuator_period",
    "actuator_torque_limit",
    "command_limit",
    "command_delay",
    "command_lag",
    "command_fade",
    "reading_delay",
    "reading_gain",
    "reading_offset",
    "geom_radius",
    "geom_friction",
    "geom_compliance",
    "fluid_density",
    "fluid_viscosity",
    "marker_mount",
    "log_clock",
)
"""considered where the user does not say which, on what the commands move:
`actuator_kp` and `actuator_kd` of position servos, `actuator_gear` of servos of speed,
`actuator_lag` of those whose control the model filters, `actuator_period` of all that
have both gains and turn joints, a limit of force of position and of speed servos,
`actuator_gain` and `command_limit` of all but position servos, `command_fade` of these
(of all at once where there are no others, else of each of few), the tilt of what is
bolted to the world, `gravity_compensation` and a fluid's numbers where the model has
some; `joint_stop` and `joint_bumper` of joints that are seen; `reading_delay` of each
reading where there are few, else of places, by a camera, beside joints, by encoders;
the radius of wheels and feet, and grip and softness of all that touch, where they touch
something, the grip of each wheel or foot where there are few; where the marker sits of
what is followed by x, y and yaw"""
TENDONS = ("tendon_damping", "tendon_friction", "tendon_stiffness")
"""on every tendon; `tendon_slack` where it has a spring, `tendon_arm` about each joint
of one that pulls several"""
PUSHED = ("joint_damping", "joint_friction", "body_mass")
"""... also on what is seen and has no motor: a block that is gripped, a door;
`joint_stiffness` where the model has a spring: a pad that gives way"""
FEW = 6  # joints up to which `RARER` are considered, too; commands, readings
RARER = (
    "joint_backlash",
    "output_backlash",
    "encoder_offset",
    "body_length",
)
"""the same of a model of few joints: many would cost more than they tell; the zero of
an encoder of position servos, play before the encoders of joints"""
OF_COMMANDS = ("command_dead_zone", "command_offset", "command_play", "command_gain")
"""the same of a model of few joints or few commands, as a car has on many joints: a
dead zone of the commands to all but position servos, a trim of the commands to these
and play in them, a scale of those to servos of speed"""
ENDING = ("joint_stop", "joint_bumper")
"""what ends a joint's motion sooner"""
LATE = ("command_delay", "command_lag")
"""of each command where there are few, and of all"""
TOUCHING = ("geom_radius", "geom_friction", "geom_compliance")
"""effects that nothing shows where nothing touches"""


def usual(config: OwnConfig, model: mujoco.MjModel) -> dict[str, tuple[str, ...]]:
    """Names of the effects, with the parts of each.

    Args:
        config: the description.
        model: the nominal model.
    """
    told = [model.actuator(item.actuator).id for item in config.told]
    moved = _moved(model, told)
    seen_on = _on(model, (_owner(model, item) for item in config.seen))
    pushed = [joint for joint in seen_on if joint not in moved]
    owned = {int(model.jnt_bodyid[j]) for j in moved}
    seen = tuple(item.channel.name for item in config.seen)
    channels = tuple(item.channel.name for item in config.told)
    tendons = tuple(
        name for n in range(model.ntendon) if (name := model.tendon(n).name)
    )
    ending = [item.part for item in config.seen if item.quantity == "joint"]
    of = {
        **_on_actuators(config, model),
        **dict.fromkeys(ENDING, ending),
        **dict.fromkeys(LATE, channels if 1 < len(channels) <= FEW else (ALL,)),
        "reading_delay": seen if 1 < len(seen) <= FEW else _by_camera(config),
        "reading_gain": seen,
        "reading_offset": seen,
        **dict.fromkeys(TENDONS, tendons),
        "tendon_slack": [n for n in tendons if _sprung(model, n)],
        "tendon_arm": ties.arms(model, fewest=2),
        "coupling_ratio": ties.followers(model),
        "body_tilt": _bolted(model, owned),
        "marker_mount": tuple(config.followed),
        "fluid_density": (ALL,) if model.opt.density else (),
        "fluid_viscosity": (ALL,) if model.opt.viscosity else (),
        "gravity_compensation": (ALL,) if model.body_gravcomp.any() else (),
        "body_length": _long(model, sorted(owned)),
        **_surfaces(model, joints=(*moved, *pushed)),
    }
    springs = [joint for joint in pushed if np.any(model.jnt_stiffness[joint])]
    free = {**dict.fromkeys(PUSHED, pushed), "joint_stiffness": springs}
    made: dict[str, tuple[str, ...]] = {}
    rarer = RARER if len(moved) <= FEW else ()
    trims = OF_COMMANDS if min(len(moved), len(told)) <= FEW else ()
    for name in (*USUAL, *rarer, *trims):
        kind = effects.OWNERS.get(name)
        if kind in ("joint", "body") and name not in of:
            parts = _parts(model, kind, moved)
            made[name] = parts + _parts(model, kind, free.get(name, []))
        else:
            made[name] = tuple(of.get(name, (ALL,)))
    return {name: parts for name, parts in made.items() if parts}


def beside(
    config: OwnConfig, model: mujoco.MjModel
) -> Mapping[str, tuple[str, ...]] | None:
    """Names of the effects that a user lists, with their parts, and what is usual
    beside them; None where the user lists none.

    Args:
        config: the description.
        model: the nominal model.
    """
    if config.effects is None:
        return None
    made = dict(config.effects)
    given = {effects.current(name): name for name in made}
    for name, parts in usual(config, model).items():
        name = given.get(name, name)
        listed = made.get(name)
        if listed is None:
            made[name] = parts
        elif listed and ALL not in (*listed, *parts):
            made[name] = tuple(dict.fromkeys((*listed, *parts)))
    return made


def _sprung(model: mujoco.MjModel, tendon: str) -> bool:
    return bool(np.any(model.tendon_stiffness[model.tendon(tendon).id]))


def _on_actuators(
    config: OwnConfig, model: mujoco.MjModel
) -> dict[str, tuple[str, ...]]:
    """Names of the actuators that each effect on them may be on, and of the commands
    that may be limited."""
    told = [model.actuator(item.actuator).id for item in config.told]
    affine = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
    servos = {n for n in told if affine[n] and model.actuator_biasprm[n][1]}
    looped = servos | {n for n in told if affine[n] and model.actuator_biasprm[n][2]}
    others, paced = set(told) - servos, looped - servos
    damped = affine & (model.actuator_biasprm[:, 1:3] != 0).all(axis=1)
    turning = model.actuator_trntype[damped] == mujoco.mjtTrn.mjTRN_JOINT
    on = {
        "actuator_gain": others,
        "actuator_gear": paced,
        "actuator_kp": servos,
        "actuator_kd": {n for n in servos if model.actuator_biasprm[n][2]},
        "actuator_lag": {n for n in told if model.actuator_dyntype[n] in FILTERS},
        "actuator_torque_limit": {n for n in looped if model.actuator_forcelimited[n]},
    }
    named = {
        name: tuple(model.actuator(n).name for n in told if n in which)
        for name, which in on.items()
    }
    channels = [item.channel.name for item in config.told]

    def to(which: set[int]) -> tuple[str, ...]:
        return tuple(c for n, c in zip(told, channels, strict=True) if n in which)

    pushing = to(others)
    return named | {
        "actuator_period": (ALL,) if on["actuator_kd"] and turning.all() else (),
        "encoder_offset": _turned(model, (n for n in told if n in servos)),
        "output_backlash": _turned(model, told),
        "command_limit": pushing,
        "command_dead_zone": pushing,
        "command_gain": to(paced),
        **dict.fromkeys(("command_offset", "command_play"), to(servos)),
        "command_fade": _fading(pushing, channels),
    }


def _turned(model: mujoco.MjModel, actuators: Iterable[int]) -> tuple[str, ...]:
    """Names of the joints that some actuators drive."""
    joints = (prepared.driven(model, actuator) for actuator in actuators)
    return tuple(model.joint(joint).name for joint in joints if joint >= 0)


def _fading(pushing: tuple[str, ...], channels: Sequence[str]) -> tuple[str, ...]:
    """Commands that a battery may fade, of those that no position servo holds."""
    if len(pushing) == len(channels):
        return (ALL,)
    return pushing if len(pushing) <= FEW else ()


def _parts(model: mujoco.MjModel, kind: str, joints: Iterable[int]) -> tuple[str, ...]:
    """Names of the hinges and slides among joints, or of the bodies on them."""
    if kind == "joint":
        found = [model.joint(j).name for j in joints if prepared.hinged(model, j)]
    else:
        owned = {int(model.jnt_bodyid[j]) for j in joints}
        found = [model.body(number).name for number in sorted(owned)]
    return tuple(name for name in found if name)


def _by_camera(config: OwnConfig) -> tuple[str, ...]:
    """Channels of places, where joints are seen as well: of two clocks one is late."""
    places = [item.quantity in PLACES for item in config.seen]
    if all(places):
        return ()
    return tuple(
        item.channel.name
        for item, place in zip(config.seen, places, strict=True)
        if place
    )


def _long(model: mujoco.MjModel, bodies: Iterable[int]) -> list[str]:
    """Names of the bodies that turn and have a length: from their joint to the one body
    that they carry, or to their centre of mass; a free body has none."""
    found = []
    for body in bodies:
        if prepared.free_joint(model, body) >= 0:
            continue
        carried = np.flatnonzero(model.body_parentid == body)
        end = model.body_pos[carried[0]] if len(carried) == 1 else model.body_ipos[body]
        if np.linalg.norm(end) > SHORT and model.body(body).name:
            found.append(model.body(body).name)
    return found


def _moved(model: mujoco.MjModel, told: Iterable[int]) -> list[int]:
    """Joints on what the actuators that are told can move, by way of equalities and
    tendons, too: no ball that lies there."""
    joints = [prepared.driven(model, actuator) for actuator in told]
    if min(joints, default=0) < 0:
        return list(range(model.njnt))
    return _on(model, (int(model.jnt_bodyid[joint]) for joint in joints))


def _on(model: mujoco.MjModel, bodies: Iterable[int]) -> list[int]:
    """Joints of the trees of some bodies, and of what is tied to them."""
    roots = {int(model.body_rootid[body]) for body in bodies} - {0}
    roots = ties.tied(model, roots)
    return [
        joint
        for joint, body in enumerate(model.jnt_bodyid)
        if int(model.body_rootid[body]) in roots
    ]


def _owner(model: mujoco.MjModel, item: Seen) -> int:
    """Number of the body that a channel tells of."""
    if item.quantity == "body":
        return int(model.body(item.part).id)
    if item.quantity == "site":
        return int(model.site(item.part).bodyid[0])
    if item.quantity == "gyro":
        return int(model.site_bodyid[view.gyro(model, item.part)])
    if item.quantity == "tendon":
        return max(ties.by_tendon(model)[model.tendon(item.part).id], default=0)
    return int(model.joint(item.part).bodyid[0])


def _surfaces(
    model: mujoco.MjModel, joints: Iterable[int]
) -> dict[str, tuple[str, ...]]:
    """Geoms of the effects on what touches: round ones on what joints carry, and all
    where any of these can touch."""
    roots = {int(model.body_rootid[model.jnt_bodyid[joint]]) for joint in joints}
    able = [
        number
        for number in np.flatnonzero(model.geom_contype | model.geom_conaffinity)
        if int(model.body_rootid[model.geom_bodyid[number]]) in roots
    ]
    round_ = [
        model.geom(n).name for n in able if int(model.geom_type[n]) in ROUND_GEOMS
    ]
    every = (ALL,) if able else ()
    few = tuple(name for name in round_ if name)
    return {
        "geom_radius": few,
        "geom_friction": every + (few if 1 < len(few) <= FEW else ()),
        "geom_compliance": every,
    }


def _bolted(model: mujoco.MjModel, bodies: Iterable[int]) -> list[str]:
    """Names of the bodies on the world that carry some bodies and are not afloat."""
    afloat = {
        int(model.jnt_bodyid[j])
        for j in range(model.njnt)
        if not prepared.hinged(model, j)
    }
    roots = {int(model.body_rootid[body]) for body in bodies} - afloat
    return [model.body(root).name for root in sorted(roots) if model.body(root).name]
