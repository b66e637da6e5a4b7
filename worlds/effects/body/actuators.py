"""Actuators of any model: gains, and the largest force."""

from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, Parameter, factor
from bns.worlds.effects.parts import ALL, UNSERVOED, WIDE

NO_BIAS, AFFINE = 0, 1  # mjtBias
LEAST = 1e-9  # of the force; MuJoCo takes a range of nothing for no limit at all


def _factor(doc: str, example: float) -> tuple[Parameter, ...]:
    return (factor((0.0, WIDE), doc, example=example),)


class ActuatorGain(BodyEffect):
    """An actuator is weaker, or stronger, than the model says."""

    name = "actuator_gain"
    source = "MuJoCo's actuator model: gain and bias scaled together"
    robots = UNSERVOED
    choices = parts.part("actuator")
    parameters = _factor("force over the model's", 0.7)

    def _write(self, spec: Any) -> None:
        for item in parts.actuators(spec, self["part"]):
            item.gainprm = np.asarray(item.gainprm) * self["factor"]
            item.biasprm = np.asarray(item.biasprm) * self["factor"]


def _servos(spec: Any, which: str, gain: int, called: str) -> list[Any]:
    """Position actuators whose number `gain` of the bias is not zero."""
    some = parts.actuators(spec, which)
    fits = [
        item
        for item in some
        if item.biastype == AFFINE and item.biasprm[1] and item.biasprm[gain]
    ]
    lacking = [item.name for item in some if item not in fits]
    if not fits or (lacking and which != ALL):
        raise BnsError(
            f"Actuator {', '.join(map(repr, lacking))} has no {called} to scale: give "
            "a position actuator with one (`kp`, `kv`)."
        )
    return fits


class ActuatorKp(BodyEffect):
    """The position gain of a servo differs from the model's."""

    name = "actuator_kp"
    source = "MuJoCo's position actuator: force = kp (goal - position) - kd speed"
    robots = UNSERVOED
    choices = parts.part("actuator")
    parameters = _factor("kp over the model's", 0.7)

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: an actuator has no such gain to scale.
        """
        for item in _servos(spec, self["part"], 1, "position gain"):
            item.gainprm[0] *= self["factor"]
            item.biasprm[1] *= self["factor"]
            if item.biasprm[2] > 0 and self["factor"] > 0:  # a damping ratio
                item.biasprm[2] /= np.sqrt(self["factor"])


class ActuatorKd(BodyEffect):
    """The damping gain of a servo differs from the model's."""

    name = "actuator_kd"
    source = "MuJoCo's position actuator: force = kp (goal - position) - kd speed"
    robots = UNSERVOED
    choices = parts.part("actuator")
    parameters = _factor("kd over the model's", 0.5)

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: an actuator has no such gain to scale.
        """
        for item in _servos(spec, self["part"], 2, "damping gain"):
            item.biasprm[2] *= self["factor"]


class ActuatorTorqueLimit(BodyEffect):
    """An actuator's largest force or torque differs from the model's.

    Where the model gives no range of forces, the largest one is the gain times the
    largest control.
    """

    name = "actuator_torque_limit"
    source = "MuJoCo's actuator model: the range of forces"
    robots = UNSERVOED
    choices = parts.part("actuator")
    parameters = _factor("largest force over the model's", 0.5)

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: an actuator has no force range to scale.
        """
        for item in parts.actuators(spec, self["part"]):
            force = np.array(item.forcerange)
            if not force.any() and item.biastype == NO_BIAS:
                force = np.array(item.ctrlrange) * item.gainprm[0]
            if not force.any():
                raise BnsError(
                    f"Actuator {item.name!r} has no force range to scale: give it a "
                    "`forcerange` in the model."
                )
            item.forcerange = np.sort(force * max(self["factor"], LEAST))
            item.forcelimited = True
