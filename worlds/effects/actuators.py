"""Actuators of any model: force, gear, gains, filter, limit."""

from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, Parameter, factor, strength
from bns.worlds.effects.parts import ALL, UNSERVOED, WIDE

NO_BIAS, AFFINE = 0, 1  # mjtBias
MUSCLE = 2  # mjtGain
FORCES = slice(2, 4)  # of a muscle's numbers: its peak force, and what that comes from
LEAST = 1e-9  # of the force; MuJoCo takes a range of nothing for no limit at all


def _factor(doc: str, example: float) -> Parameter:
    return factor((0.0, WIDE), doc, example=example)


class ActuatorGain(BodyEffect):
    """An actuator is weaker, or stronger, than the model says."""

    name = "actuator_gain"
    source = "MuJoCo's actuator model: gain and bias scaled; of a muscle, the force"
    robots = UNSERVOED
    choices = parts.part("actuator")
    parameter = _factor("force over the model's", 0.7)

    def _write(self, spec: Any) -> None:
        for item in parts.actuators(spec, self["part"]):
            numbers = FORCES if item.gaintype == MUSCLE else slice(None)
            for values in (item.gainprm, item.biasprm):
                values[numbers] *= self["factor"]


class ActuatorGear(BodyEffect):
    """An actuator's gear differs from the model's: a gear ratio, a pulley, a lever.

    A wheel or a drum that is larger by 6 % moves that much farther a turn: its gear is
    1 / 1.06 of the model's. A motor is as much stronger as its gear is higher, like one
    of more gain; a servo of position or speed goes as much less far, too.
    """

    name = "actuator_gear"
    source = "MuJoCo's transmission: length = gear x position, force = gear x force"
    robots = ("own",)
    choices = parts.part("actuator")
    parameter = factor((0.1, 10.0), "gear over the model's", example=0.9)

    def _write(self, spec: Any) -> None:
        for item in parts.actuators(spec, self["part"]):
            item.gear = np.asarray(item.gear) * self["factor"]


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
    parameter = _factor("kp over the model's", 0.7)

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
    parameter = _factor("kd over the model's", 0.5)

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: an actuator has no such gain to scale.
        """
        for item in _servos(spec, self["part"], 2, "damping gain"):
            item.biasprm[2] *= self["factor"]


class ActuatorPeriod(BodyEffect):
    """A servo's loop runs in a computer, once in a period.

    It holds its force for that long, and takes speeds from two of its readings: it goes
    by where the joint was half a period ago, and by how fast it was a whole one ago. To
    first order that is a loop with less damping, by kp period / 2, on a joint with
    less armature, by kd period, of which it has none at least.
    """

    name = "actuator_period"
    source = "zero-order hold and backward difference; bounds assumed"
    robots = ("own",)
    choices = parts.part("actuator")
    parameter = strength("period", "s", (0.0, 0.5), "of the loop", example=0.02)

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`; what a damping ratio comes to stays.

        Raises:
            BnsError: an actuator has no damping gain.
        """
        period = self["period"]
        chosen = _servos(spec, self["part"], 2, "damping gain")
        if any(item.biasprm[2] > 0 for item in chosen):  # a damping ratio
            model = spec.copy().compile()
            for number, item in enumerate(spec.actuators):
                if item in chosen:
                    item.biasprm[2] = model.actuator_biasprm[number, 2]
        for item in chosen:
            kp, kd = -item.biasprm[1], -item.biasprm[2]
            (joint,) = parts.joints(spec, item.target)
            joint.armature = max(joint.armature - kd * period * item.gear[0] ** 2, 0.0)
            item.biasprm[2] += kp * period / 2


UNFILTERED = 0  # mjtDyn: none
QUICKEST = 1e-4  # [s] that a filter keeps: MuJoCo divides by it


class ActuatorLag(BodyEffect):
    """An actuator follows its control more gradually than the model says.

    A valve, a motor's winding, a muscle. What is added is the time constant of MuJoCo's
    activation, by which forces follow, not what is told; an actuator without one gets
    one, and begins without force.
    """

    name = "actuator_lag"
    source = "MuJoCo's first-order filter: act' = (control - act) / time constant"
    robots = ("own",)
    choices = parts.part("actuator")
    resizes = True
    parameter = strength(
        "added", "s", (-WIDE, WIDE), "to the time constant of its filter", example=0.05
    )

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: an actuator has dynamics of another kind.
        """
        for item in parts.actuators(spec, self["part"]):
            if item.dyntype == UNFILTERED:
                item.dyntype, item.dynprm[0] = parts.FILTERS[0], 0.0
            if item.dyntype not in parts.FILTERS:
                raise BnsError(
                    f"Actuator {item.name!r} has dynamics without a time constant: "
                    "give one with `dyntype` none, filter or filterexact."
                )
            item.dynprm[0] = max(item.dynprm[0] + self["added"], QUICKEST)


class ActuatorTorqueLimit(BodyEffect):
    """An actuator's largest force or torque differs from the model's.

    Where the model gives no range of forces, the largest one is the gain times the
    largest control.
    """

    name = "actuator_torque_limit"
    source = "MuJoCo's actuator model: the range of forces"
    robots = UNSERVOED
    choices = parts.part("actuator")
    parameter = _factor("largest force over the model's", 0.5)

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
