"""A user's MJCF as the diagnosis needs it: actuators with names, loops closed."""

from collections.abc import Sequence

import mujoco
import numpy as np

from bns.errors import BnsError
from bns.gap.models.mjcf.config import OwnConfig, Told
from bns.models import mjcf as mjcf_file


def spec(config: OwnConfig) -> mujoco.MjSpec:
    """The model of a description.

    Actuators without a name are called as their joint (or tendon, site, body) is.
    Where the description gives the gains of a position loop, the actuator becomes one
    (what it did before is dropped), or is added to the joint of that name.

    Raises:
        BnsError: a loop on what is no joint.
        ValueError: MuJoCo refuses the file.
    """
    made = mjcf_file.load(config.model)
    name_actuators(made)
    for told in config.told:
        if told.kp:
            _close(made, told)
    return made


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
