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
from bns.gap.candidates.mjcf_usual import usual
from bns.gap.decomposition.row import Row
from bns.gap.models.mjcf import effects, ties
from bns.gap.models.mjcf.config import OwnConfig
from bns.worlds.effects.base import SensorEffect
from bns.worlds.effects.parts import ALL, FILTERS, WIDE

DEAD = ("command_dead_band", "command_dead_zone", "command_play")  # sizes, from 0
RATIOS = (0.4, 0.6, 0.8, 0.9, 1.1, 1.25, 1.6, 2.5)
SHARES = (0.02, 0.05, 0.12, 0.3, 1.0)  # of the largest value, beyond the nominal
LOWER = (0.9, 0.5, 0.2)  # of the nominal value, taken off
LATE = (0.01, 0.03, 0.08, 0.2, 0.5)  # [s]
EIGHTH = 0.125  # of a range: a plausible departure where nothing else is known
# Times the largest value that is looked for first: geared servos have much friction and
# inertia for the links that they move; assumed.
WIDER = 10.0
SLOWEST = 0.03  # [s] period of a loop
FASTEST = 0.1  # of a clock, which may be as slow
FADED = 0.2  # lost with each trial at most
LEAST = 0.002  # of a limit in the model, which may be far beyond the robot's
TILT = 0.5  # [rad] largest tilt of a body
FREE = ((-np.pi, np.pi), (-1.0, 1.0))  # [rad], [m] of a joint without stops
MOST = {
    "damping": 10.0,
    "friction": 5.0,
    "stribeck": 5.0,
    "armature": 1.0,
    "stiffness": 20.0,
    "bumper": 2000.0,
}
"""largest number of a joint or tendon over the inertia that it moves, SI; assumed"""
SLACK = 0.02  # [m] of a tendon at most
PLAY = 0.3  # [rad or m] largest play, or offset of an encoder
RANGES = {
    "actuator_gear": (0.7, 1.4, "1"),
    "actuator_period": (0.0, SLOWEST, "s"),
    "actuator_torque_limit": (LEAST, 3.0, "1"),
    "body_length": (0.7, 1.4, "1"),
    "body_tilt": (-TILT, TILT, "rad"),
    "geom_friction": (0.02, 5.0, "1"),
    "geom_compliance": (0.2, 10.0, "1"),
    "geom_radius": (0.7, 1.4, "1"),
    "gravity_compensation": (-1.0, 1.0, "1"),
    "tendon_slack": (0.0, SLACK, "m"),
    "tendon_arm": (0.5, 2.0, "1"),
    "coupling_ratio": (0.5, 2.0, "1"),
    "log_clock": (-FASTEST, FASTEST, "1"),
}
"""of effects on parts of the model that have the same on all of them"""
EXCITE = {
    "joint_damping": "fast motion of that joint",
    "joint_friction": "slow motion and reversals of that joint",
    "joint_armature": "sudden changes of speed of that joint",
    "joint_stiffness": "large excursions of that joint",
    "body_mass": "motion against gravity, or sudden changes of speed",
    "tendon_damping": "fast motion of that tendon",
    "tendon_friction": "slow motion and reversals of that tendon",
    "tendon_stiffness": "large excursions of that tendon",
    "tendon_slack": "reversals of that tendon",
    "tendon_arm": "large excursions of that joint",
    "coupling_ratio": "large excursions of that joint",
    "actuator_gain": "large commands",
    "geom_friction": "sliding",
    "geom_radius": "rolling, or steps",
    "geom_compliance": "loads that come and go",
    "command_delay": "steps",
    "command_lag": "steps",
    "command_gain": "large commands",
    "command_fade": "the same commands in many trials",
    "command_offset": "any command",
    "command_dead_band": "small commands",
    "command_dead_zone": "small commands",
    "command_play": "commands that turn back",
    "reading_gain": "large excursions",
    "reading_offset": "any command",
    "reading_delay": "fast motion",
    "marker_mount": "turns on the spot",
    "joint_stribeck": "slow motion and reversals of that joint",
    "joint_stop": "motion to where a stop may be",
    "joint_bumper": "motion to where a spring may begin",
    "joint_backlash": "reversals of that joint under changing load",
    "output_backlash": "reversals of that joint under changing load",
    "encoder_offset": "motion against gravity, or between stops",
    "body_centre": "motion against gravity, or sudden changes of speed",
    "body_length": "large excursions",
    "body_tilt": "motion against gravity",
    "fluid_density": "fast motion",
    "fluid_viscosity": "slow motion",
    "gravity_compensation": "slow motion against gravity",
    "actuator_gear": "large commands",
    "actuator_lag": "steps",
    "actuator_period": "steps",
    "actuator_kp": "steps, and loads that are held",
    "actuator_kd": "steps",
    "actuator_torque_limit": "large and sudden commands",
    "command_limit": "large commands",
    "command_rate": "large steps",
    "log_clock": "fast motion",
}
_DELAYS = {
    "command_delay[all]": ("reading_delay[all]",),
    "reading_delay[all]": ("command_delay[all]",),
}
"""alike where every command and every reading is late"""
WHOLE = ("actuator_period", "gravity_compensation")
"""effects on actuators and bodies that may be on all of them"""
UNSIGNED = ("joint_backlash", "output_backlash", "joint_stop", "joint_bumper")
"""effects on joints that are no number added to the model's"""


def candidates(config: OwnConfig, model: mujoco.MjModel) -> tuple[Row, ...]:
    """All candidates, in a fixed order.

    Args:
        config: the description.
        model: the nominal model.

    Raises:
        BnsError: an effect on a part that the model lacks, bounds for none, or bounds
            with nothing between them.
    """
    wanted = config.effects if config.effects is not None else usual(config, model)
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


def _candidates(
    name: str, part: str, config: OwnConfig, model: mujoco.MjModel
) -> Iterable[Row]:
    """One for each strength that the effect has."""
    strengths = [item for item in effects.CLASSES[name].parameters if item.scales]
    if name == "marker_mount":  # turned: an offset of the yaw that is read
        strengths = [about for about in strengths if about.unit == "m"]
    for about in strengths:
        stem = name if len(strengths) == 1 else f"{name}.{about.name}"
        low, high, unit = _range(name, part, config, model)
        given = config.bounds.get(f"{stem}[{part}]", {})
        low, high = given.get("low", low), given.get("high", high)
        if low >= high:
            raise BnsError(
                f"[bounds] {stem}[{part}]: low = {low:g} is not below high = {high:g}; "
                "give both."
            )
        signed = name.startswith("joint_") and name not in UNSIGNED
        widest = WIDER * high if signed and "high" not in given else high
        sd = EIGHTH * (high if signed else high - low)
        nominal = about.nominal
        if abs(nominal) >= WIDE:  # a limit that is nowhere: at the end of the range
            nominal = high if nominal > 0 else low
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
            excite=EXCITE.get(name, "any motion"),
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
    if kind == "place":
        config.tracked(part)
        about = effects.CLASSES[name].parameters[0]
        return about.low, about.high, about.unit
    if kind:
        return _of_model(name, kind, part, model)
    _channel(name, part, config)
    if name in ("command_delay", "reading_delay", "command_lag"):
        return 0.0, LATE[-1], "s"
    if name == "command_fade":
        return 0.0, FADED, "1"
    if name in ("command_gain", "reading_gain"):
        return RATIOS[0], RATIOS[-1], "1"
    return _of_channel(name, part, config)


def _channel(name: str, part: str, config: OwnConfig) -> None:
    """Refuse a channel that an effect on commands, or on readings, cannot be on."""
    reads = issubclass(effects.CLASSES[name], SensorEffect)
    known = [item.channel.name for item in (config.seen if reads else config.told)]
    if part != ALL and part not in known:
        kind = "observed channel" if reads else "command channel"
        raise UnknownNameError(f"{kind} in [effects] {name}", part, known)


def _of_channel(name: str, part: str, config: OwnConfig) -> tuple[float, float, str]:
    told = {item.channel.name: item for item in config.told}
    seen = {item.channel.name: item for item in config.seen}
    if part in told:
        item = told[part]
        size = max(abs(item.low), abs(item.high))
        if name == "command_limit":
            return LEAST * size, size, item.channel.unit
        if name == "command_rate":  # two seconds for the whole way
            return 0.0, 2.0 / size, f"s/({item.channel.unit})"
        low = 0.0 if name in DEAD else -0.3 * size
        unit = _unit(name, item.channel.unit)
        return low, 0.3 * size if low else 0.6 * size, unit
    if part in seen:
        size = 100 * seen[part].noise
        return -size, size, _unit(name, seen[part].channel.unit)
    raise BnsError(f"[effects] {name} needs the name of one channel, not {part!r}.")


def _unit(name: str, of: str) -> str:
    """Unit of an effect's strength on a channel in a unit."""
    (about,) = (item for item in effects.CLASSES[name].parameters if item.scales)
    unit = about.unit.replace("unit of the command", of)
    return unit.replace("unit of the reading", of)


def _of_model(
    name: str, kind: str, part: str, model: mujoco.MjModel
) -> tuple[float, float, str]:
    known = _names(model, kind)
    if part == ALL and (kind == "geom" or name in WHOLE):
        known.append(ALL)
    if part not in known:
        raise UnknownNameError(f"{kind} in [effects] {name}", part, known)
    at = known.index(part)
    if name in RANGES:
        return RANGES[name]
    if name == "actuator_lag":
        filtered = int(model.actuator_dyntype[at]) in FILTERS
        return -0.9 * model.actuator_dynprm[at, 0] * filtered, LATE[-1], "s"
    if kind in ("actuator", "geom", "model"):
        return 0.2, 3.0, "1"
    if kind == "body":
        mass = float(model.body_mass[at])
        if name == "body_mass":
            # a light hand may carry what is heavy to it, not what is to the robot
            lifted = 0.5 * float(model.body_mass.sum())
            return -0.9 * mass, max(2.0 * mass, lifted), "kg"
        size = float(np.sqrt(model.body_inertia[at].max() / max(mass, 1e-9)))
        return -size, size, "m"
    if kind == "tendon":
        return _of_tendon(name, at, model)
    return _of_joint(name, at, model)


def _of_joint(name: str, joint: int, model: mujoco.MjModel) -> tuple[float, float, str]:
    dof = int(model.jnt_dofadr[joint])
    _, full = _inertia(model)
    inertia = float(full[dof, dof])
    slide = int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
    if name == "joint_stop":
        low, high = model.jnt_range[joint] if model.jnt_limited[joint] else FREE[slide]
        return float(low), float(high), "m" if slide else "rad"
    if name in ("encoder_offset", "joint_backlash", "output_backlash"):
        low = -PLAY if name == "encoder_offset" else 0.0
        return low, PLAY, "m" if slide else "rad"
    number = name.removeprefix("joint_")
    now, unit = {
        "damping": (model.dof_damping[dof], "N m s/rad"),
        "friction": (model.dof_frictionloss[dof], "N m"),
        "stribeck": (0.0, "N m"),
        "armature": (model.dof_armature[dof], "kg m2"),
        "stiffness": (model.jnt_stiffness[joint], "N m/rad"),
        "bumper": (0.0, "N m/rad"),
    }[number]
    if slide:
        unit = {"N m s/rad": "N s/m", "N m": "N", "kg m2": "kg"}.get(unit, "N/m")
    return *_about(now, MOST[number] * inertia), unit


def _of_tendon(
    name: str, tendon: int, model: mujoco.MjModel
) -> tuple[float, float, str]:
    """Lowest and highest value, and the unit, from the mass that it feels: that of the
    joints, in the model's first pose, by its lever arms."""
    (data, full), step = _inertia(model), 1e-6
    begun, first = data.qpos.copy(), float(data.ten_length[tendon])
    arms = np.zeros(model.nv)
    for dof in range(model.nv):
        data.qpos[:] = begun
        mujoco.mj_integratePos(model, data.qpos, step * np.eye(model.nv)[dof], 1.0)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        arms[dof] = (data.ten_length[tendon] - first) / step
    felt = float(arms @ np.linalg.solve(full, arms))
    number = name.removeprefix("tendon_")
    now, unit = {
        "damping": (model.tendon_damping[tendon], "N s/m"),
        "friction": (model.tendon_frictionloss[tendon], "N"),
        "stiffness": (model.tendon_stiffness[tendon], "N/m"),
    }[number]
    return *_about(now, MOST[number] / max(felt, 1e-9)), unit


def _inertia(model: mujoco.MjModel) -> tuple[mujoco.MjData, np.ndarray]:
    """A model in its first pose, and its inertia there, ``(nv, nv)``."""
    data, full = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, full)
    return data, full


def _about(now: float | np.ndarray, most: float) -> tuple[float, float]:
    """Lowest and highest of what is added to a number that may not be below 0."""
    now = float(np.ravel(now)[0])
    return -now, float(max(most, 5.0 * now))


def _names(model: mujoco.MjModel, kind: str) -> list[str]:
    if kind == "model":
        return [ALL]
    if kind == "lever arm":
        return ties.arms(model)
    if kind == "follower":
        return ties.followers(model)
    count = {
        "joint": model.njnt,
        "body": model.nbody,
        "actuator": model.nu,
        "geom": model.ngeom,
        "tendon": model.ntendon,
    }[kind]
    return [getattr(model, kind)(number).name for number in range(count)]
