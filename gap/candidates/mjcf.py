"""What may explain a gap of a user's own model: which effects, parts and ranges.

Ranges that the user does not give follow from the model: from the number itself where
it is not zero, else from the inertia that the joint moves, so that the largest value
matters within a second.
"""

from collections.abc import Iterable
from dataclasses import replace

import mujoco
import numpy as np

from bns.errors import BnsError, UnknownNameError
from bns.gap.decomposition.row import Row
from bns.gap.models.mjcf import effects, prepared
from bns.gap.models.mjcf.config import PLACES, OwnConfig, Seen
from bns.worlds.effects.parts import ALL, ROUND_GEOMS, WIDE

RATIOS = (0.4, 0.6, 0.8, 0.9, 1.1, 1.25, 1.6, 2.5)
SHARES = (0.02, 0.05, 0.12, 0.3, 1.0)  # of the largest value, beyond the nominal
LOWER = (0.9, 0.5, 0.2)  # of the nominal value, taken off
LATE = (0.01, 0.03, 0.08, 0.2, 0.5)  # [s]
EIGHTH = 0.125  # of a range: a plausible departure where nothing else is known
# Times the largest value that is looked for first: geared servos have much friction and
# inertia for the links that they move; assumed.
WIDER = 10.0
SLOWEST = 0.03  # [s] period of a loop
LEAST = 0.002  # of a limit in the model, which may be far beyond the robot's
SHORT = 1e-6  # [m] no length
TILT = 0.5  # [rad] largest tilt of a body
FREE = ((-np.pi, np.pi), (-1.0, 1.0))  # [rad], [m] of a joint without stops
PLAY = 0.3  # [rad or m] largest play, or offset of an encoder
EXCITE = {
    "joint_damping": "fast motion of that joint",
    "joint_friction": "slow motion and reversals of that joint",
    "joint_armature": "sudden changes of speed of that joint",
    "joint_stiffness": "large excursions of that joint",
    "body_mass": "motion against gravity, or sudden changes of speed",
    "actuator_gain": "large commands",
    "geom_friction": "sliding",
    "geom_radius": "rolling, or steps",
    "geom_compliance": "loads that come and go",
    "command_delay": "steps",
    "command_lag": "steps",
    "command_gain": "large commands",
    "command_offset": "any command",
    "command_dead_zone": "small commands",
    "reading_gain": "large excursions",
    "reading_offset": "any command",
    "reading_delay": "fast motion",
    "joint_stribeck": "slow motion and reversals of that joint",
    "joint_stop": "motion to where a stop may be",
    "joint_backlash": "reversals of that joint under changing load",
    "encoder_offset": "motion against gravity, or between stops",
    "body_centre": "motion against gravity, or sudden changes of speed",
    "body_length": "large excursions",
    "body_tilt": "motion against gravity",
    "actuator_period": "steps",
    "actuator_kp": "steps, and loads that are held",
    "actuator_kd": "steps",
    "actuator_torque_limit": "large and sudden commands",
    "command_limit": "large commands",
    "command_rate": "large steps",
}
_DELAYS = {
    "command_delay[all]": ("reading_delay[all]",),
    "reading_delay[all]": ("command_delay[all]",),
}
"""alike where every command and every reading is late"""
USUAL = (
    "joint_damping",
    "joint_friction",
    "joint_armature",
    "joint_stiffness",
    "joint_stop",
    "body_mass",
    "body_tilt",
    "actuator_gain",
    "actuator_kp",
    "actuator_kd",
    "actuator_period",
    "actuator_torque_limit",
    "command_limit",
    "command_delay",
    "command_lag",
    "reading_delay",
    "reading_gain",
    "reading_offset",
    "geom_radius",
    "geom_friction",
    "geom_compliance",
)
"""considered where the user does not say which, on what the commands move:
`actuator_kp` and `actuator_kd` of position servos, `actuator_period` of all whose gains
the description gives, a limit of force of these and of servos of speed, `actuator_gain`
and `command_limit` of all but position servos, the tilt of what is bolted to the world;
`joint_stop` of joints that are seen; `command_lag` of each command where there are few,
and of all; `reading_delay` of each reading where there are few, else of places, by a
camera, beside joints, by encoders; the radius of wheels and feet, and grip and softness
of all that touch, where they touch something"""
PUSHED = ("joint_damping", "joint_friction", "body_mass")
"""... also on what is seen and has no motor: a block that is gripped, a door"""
FEW = 6  # joints up to which `RARER` are considered, too; commands, readings
RARER = ("joint_backlash", "body_length")
"""the same of a model of few joints: many would cost more than they tell"""
UNSIGNED = ("joint_backlash", "joint_stop")
"""effects on joints that are no number added to the model's"""
TOUCHING = ("geom_radius", "geom_friction", "geom_compliance")
"""effects that nothing shows where nothing touches"""


def candidates(config: OwnConfig, model: mujoco.MjModel) -> tuple[Row, ...]:
    """All candidates, in a fixed order.

    Args:
        config: the description.
        model: the nominal model.

    Raises:
        BnsError: an effect on a part that the model lacks, or bounds for none.
    """
    wanted = config.effects if config.effects is not None else _usual(config, model)
    config = replace(
        config, bounds={effects.current(k): row for k, row in config.bounds.items()}
    )
    made = []
    for name, parts in wanted.items():
        given, name = name, effects.current(name)
        if name not in effects.CLASSES:
            raise UnknownNameError("effect in [effects]", name, effects.CLASSES)
        for part in parts or (ALL,):
            found = _candidates(name, part, config, model)
            made += [_called(item, given) for item in found]
    known = [effects.current(item.name) for item in made]
    for name in config.bounds:
        if name not in known:
            raise UnknownNameError("effect in [bounds]", name, known)
    if not made:
        raise BnsError("[effects] names no effect; leave it out to consider the usual.")
    return tuple(made)


def _called(item: Row, given: str) -> Row:
    """A candidate under the name that the user gave its effect."""
    return replace(item, name=given + item.name.removeprefix(item.effect))


def _usual(config: OwnConfig, model: mujoco.MjModel) -> dict[str, tuple[str, ...]]:
    told = [model.actuator(item.actuator).id for item in config.told]
    moved = _moved(model, told)
    seen_on = _on(model, (_owner(model, item) for item in config.seen))
    pushed = [joint for joint in seen_on if joint not in moved]
    owned = {int(model.jnt_bodyid[j]) for j in moved}
    seen = tuple(item.channel.name for item in config.seen)
    channels = tuple(item.channel.name for item in config.told)
    affine = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
    servos = {n for n in told if affine[n] and model.actuator_biasprm[n][1]}
    looped = servos | {n for n in told if affine[n] and model.actuator_biasprm[n][2]}
    damped = {number for number in servos if model.actuator_biasprm[number][2]}
    limited = {number for number in told if model.actuator_forcelimited[number]}
    of = {
        "actuator_gain": set(told) - servos,
        "actuator_kp": servos,
        "actuator_kd": damped,
        "actuator_torque_limit": limited & looped,
        "command_limit": [
            item.channel.name
            for item, number in zip(config.told, told, strict=True)
            if number not in servos
        ],
        "joint_stop": [item.part for item in config.seen if item.quantity == "joint"],
        "command_lag": channels if 1 < len(channels) <= FEW else (ALL,),
        "reading_delay": seen if 1 < len(seen) <= FEW else _by_camera(config),
        "reading_gain": seen,
        "reading_offset": seen,
        "body_tilt": _bolted(model, owned),
        "body_length": _long(model, sorted(owned)),
        **_surfaces(model, joints=(*moved, *pushed)),
    }
    made: dict[str, tuple[str, ...]] = {}
    for name in (*USUAL, *(RARER if len(moved) <= FEW else ())):
        kind = effects.OWNERS.get(name)
        if name == "actuator_period":
            made[name] = (ALL,) if any(item.kd for item in config.told) else ()
        elif kind == "actuator":
            made[name] = tuple(model.actuator(n).name for n in told if n in of[name])
        elif kind and name not in of:
            parts = _parts(model, kind, moved)
            made[name] = parts + (_parts(model, kind, pushed) if name in PUSHED else ())
        else:
            made[name] = tuple(of.get(name, (ALL,)))
    return {name: parts for name, parts in made.items() if parts}


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
    that they carry, or to their centre of mass."""
    found = []
    for body in bodies:
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
    roots = prepared.tied(model, roots)
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
    return {
        "geom_radius": tuple(name for name in round_ if name),
        "geom_friction": every,
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


def _candidates(
    name: str, part: str, config: OwnConfig, model: mujoco.MjModel
) -> Iterable[Row]:
    """One for each strength that the effect has."""
    strengths = [item for item in effects.CLASSES[name].parameters if item.scales]
    for about in strengths:
        stem = name if len(strengths) == 1 else f"{name}.{about.name}"
        low, high, unit = _range(name, part, config, model)
        given = config.bounds.get(f"{stem}[{part}]", {})
        low, high = given.get("low", low), given.get("high", high)
        signed = name.startswith("joint_") and name not in UNSIGNED
        widest = WIDER * high if signed and "high" not in given else high
        sd = EIGHTH * (high if signed else high - low)
        nominal = about.nominal
        if name == "command_limit" or nominal == WIDE:
            nominal = high
        elif nominal == -WIDE:
            nominal = low
        yield Row(
            name=f"{stem}[{part}]",
            effect=name,
            parameter=about.name,
            unit=unit,
            nominal=nominal,
            low=min(low, nominal),
            high=max(widest, nominal),
            sd=max(sd, 1e-12),
            levels=_grid(nominal, low, high),
            fixed={"part": part},
            slack=given.get("slack", 0.0),
            excite=EXCITE[name],
            aliases=_DELAYS.get(f"{stem}[{part}]", ()),
        )


def _grid(nominal: float, low: float, high: float) -> tuple[float, ...]:
    if nominal == high > 0:  # a limit
        return tuple(low + share * (high - low) for share in (0.0, *SHARES[:-1]))
    if nominal == 1.0:
        inside = [ratio for ratio in RATIOS if low <= ratio <= high]
        return tuple(sorted({*inside, low, high} - {nominal}))
    up = [share * high for share in SHARES if high > 0]
    down = [share * low for share in LOWER if low < 0]
    if low < 0 and abs(low) >= high:  # both ways alike: a signed quantity
        down = [share * low for share in SHARES]
    return tuple(sorted({*down, *up}))


def _range(
    name: str, part: str, config: OwnConfig, model: mujoco.MjModel
) -> tuple[float, float, str]:
    """Lowest and highest value, and the unit."""
    kind = effects.OWNERS.get(name)
    if kind:
        return _of_model(name, kind, part, model)
    if name in ("command_delay", "reading_delay", "command_lag"):
        _channel(part, config)
        return 0.0, LATE[-1], "s"
    if name in ("command_gain", "reading_gain"):
        _channel(part, config)
        return RATIOS[0], RATIOS[-1], "1"
    return _of_channel(name, part, config)


def _channel(part: str, config: OwnConfig) -> None:
    known = [item.channel.name for item in config.told]
    known += [item.channel.name for item in config.seen]
    if part != ALL and part not in known:
        raise UnknownNameError("channel in [effects]", part, known)


def _of_channel(name: str, part: str, config: OwnConfig) -> tuple[float, float, str]:
    _channel(part, config)
    told = {item.channel.name: item for item in config.told}
    seen = {item.channel.name: item for item in config.seen}
    if part in told:
        item = told[part]
        size = max(abs(item.low), abs(item.high))
        if name == "command_limit":
            return LEAST * size, size, item.channel.unit
        if name == "command_rate":  # two seconds for the whole way
            return 0.0, 2.0 / size, f"s/({item.channel.unit})"
        low = 0.0 if name == "command_dead_zone" else -0.3 * size
        return low, 0.3 * size if low else 0.6 * size, item.channel.unit
    if part in seen:
        size = 100 * seen[part].noise
        return -size, size, seen[part].channel.unit
    raise BnsError(f"[effects] {name} needs the name of one channel, not {part!r}.")


def _of_model(
    name: str, kind: str, part: str, model: mujoco.MjModel
) -> tuple[float, float, str]:
    known = _names(model, kind)
    if part == ALL and (kind == "geom" or name == "actuator_period"):
        known.append(ALL)
    if part not in known:
        raise UnknownNameError(f"{kind} in [effects] {name}", part, known)
    at = known.index(part)
    if name == "actuator_torque_limit":
        return LEAST, 3.0, "1"
    if name == "actuator_period":
        return 0.0, SLOWEST, "s"
    if name == "geom_radius":
        return 0.7, 1.4, "1"
    if name == "geom_compliance":
        return 0.2, 10.0, "1"
    if kind in ("actuator", "geom"):
        return 0.2, 3.0, "1"
    if name == "body_tilt":
        return -TILT, TILT, "rad"
    if name == "body_length":
        return 0.7, 1.4, "1"
    if kind == "body":
        mass = float(model.body_mass[at])
        if name == "body_mass":
            # a light hand may carry what is heavy to it, not what is to the robot
            lifted = 0.5 * float(model.body_mass.sum())
            return -0.9 * mass, max(2.0 * mass, lifted), "kg"
        size = float(np.sqrt(model.body_inertia[at].max() / max(mass, 1e-9)))
        return -size, size, "m"
    return _of_joint(name, at, model)


def _of_joint(name: str, joint: int, model: mujoco.MjModel) -> tuple[float, float, str]:
    dof = int(model.jnt_dofadr[joint])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    inertia = float(full[dof, dof])
    slide = int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
    if name == "joint_stop":
        low, high = model.jnt_range[joint] if model.jnt_limited[joint] else FREE[slide]
        return float(low), float(high), "m" if slide else "rad"
    if name in ("encoder_offset", "joint_backlash"):
        low = -PLAY if name == "encoder_offset" else 0.0
        return low, PLAY, "m" if slide else "rad"
    now, high, unit = {
        "joint_damping": (model.dof_damping[dof], 10.0 * inertia, "N m s/rad"),
        "joint_friction": (model.dof_frictionloss[dof], 5.0 * inertia, "N m"),
        "joint_stribeck": (0.0, 5.0 * inertia, "N m"),
        "joint_armature": (model.dof_armature[dof], inertia, "kg m2"),
        "joint_stiffness": (model.jnt_stiffness[joint], 20.0 * inertia, "N m/rad"),
    }[name]
    if slide:
        unit = {"N m s/rad": "N s/m", "N m": "N", "kg m2": "kg"}.get(unit, "N/m")
    now = float(np.ravel(now)[0])
    return -now, float(max(high, 5.0 * now)), unit


def _names(model: mujoco.MjModel, kind: str) -> list[str]:
    count = {
        "joint": model.njnt,
        "body": model.nbody,
        "actuator": model.nu,
        "geom": model.ngeom,
    }[kind]
    return [getattr(model, kind)(number).name for number in range(count)]
