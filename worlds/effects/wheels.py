"""Wheels and their motors: sizes, friction, torque; lag, play and the battery."""

from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.worlds.effects import parts
from bns.worlds.effects.base import (
    ActuatorEffect,
    BodyEffect,
    Choice,
    ControlSignal,
    factor,
    strength,
)
from bns.worlds.effects.command import WHEEL, Fading, columns, lagged, spans
from bns.worlds.effects.surfaces import set_cone


class AxleLength(BodyEffect):
    """The wheels are further apart or closer than in the model."""

    name = "axle_length"
    source = "published lengths run from 87.4 to 91.6 mm (5 %)"
    parameter = factor(
        (0.7, 1.3),
        "true distance of the wheels over the model's; bounds assumed",
        example=1.1,
    )

    def _write(self, spec: Any) -> None:
        left, right = (parts.wheel(spec, side) for side in ("left", "right"))
        growth = (self["factor"] - 1) * (left.pos - right.pos) / 2
        left.pos += growth
        right.pos -= growth


class WheelDiameter(BodyEffect):
    """A wheel is larger or smaller than the model's.

    The wheel's axle is moved up on the body by as much as the radius grows, so that the
    wheel touches the floor where it did: the speed changes, the attitude does not (a
    true robot would lean by 0.13 deg for 1 % of one diameter), and the start pose needs
    no settling. The wheel's mass and inertia stay.
    """

    name = "wheel_diameter"
    source = "published diameters are 41, 42 and 42.4 mm (3 %); level attitude assumed"
    choices = (WHEEL,)
    parameter = factor(
        (0.7, 1.3), "true diameter over the model's; bounds assumed", example=0.95
    )

    def _write(self, spec: Any) -> None:
        for side in self.wheels():
            body = parts.wheel(spec, side)
            radius = max(geom.size[0] for geom in parts.contact_geoms(body))
            for geom in body.geoms:
                geom.size[0] *= self["factor"]
            body.pos[2] += (self["factor"] - 1) * radius


FADES = 1.0  # [rad/s] of a wheel, at which its breakaway is 37 %; 2 cm/s; assumed


class RollingDrag(BodyEffect):
    """A wheel turns against friction.

    friction = torque + viscous |v| + breakaway exp(-(v / FADES)^2) in steady motion.
    """

    name = "rolling_drag"
    source = (
        "Coulomb, viscous and Stribeck model assumed; a wheel's motor gives up to "
        "0.057 N m"
    )
    choices = (WHEEL,)
    resizes = True
    parameters = (
        strength(
            "torque",
            "N m",
            (0.0, 0.057),
            "dry friction; upper bound: the motor's torque (Webots Khepera3)",
            example=0.002,
        ),
        strength(
            "viscous",
            "N m s/rad",
            (0.0, 0.01),
            "friction per wheel speed; bounds assumed",
            example=0.0002,
        ),
        strength(
            "breakaway",
            "N m",
            (0.0, 0.057),
            "dry friction at standstill beyond `torque`; bounds as there",
            example=0.003,
        ),
    )

    def _write(self, spec: Any) -> None:
        for side in self.wheels():
            joint = parts.joint(spec, side)
            joint.frictionloss += self["torque"]
            joint.damping[0] += self["viscous"]
        if self["breakaway"]:
            held = [parts.joint(spec, side) for side in self.wheels()]
            parts.stick(spec, held, self["breakaway"], FADES)


LEAST = 1e-9  # of the torque; MuJoCo takes a range of nothing for no limit at all


class TorqueLimit(BodyEffect):
    """A wheel's motor is weaker than in the model."""

    name = "torque_limit"
    source = "nominal 0.057 N m: Webots Khepera3; bounds assumed"
    choices = (WHEEL,)
    parameter = factor((0.0, 1.0), "largest torque over the model's", example=0.02)

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: an actuator has no force range to scale.
        """
        for side in self.wheels():
            motor = parts.actuator(spec, side)
            if not motor.forcerange.any():
                raise BnsError(
                    f"Actuator {motor.name!r} has no force range to scale: give it a "
                    "`forcerange` in the model."
                )
            share = max(self["factor"], LEAST)
            motor.forcerange = np.asarray(motor.forcerange) * share


class WheelEccentricity(BodyEffect):
    """A wheel turns about an axle beside its centre.

    At a steady rate w of turning the robot's speed there is w (r + offset sin(a)), a
    being the wheel's angle plus the phase; over whole turns nothing is lost. The
    wheel's mass stays on the axle.
    """

    name = "wheel_eccentricity"
    source = "rolling without slip; bounds assumed"
    choices = (WHEEL,)
    parameters = (
        strength(
            "offset",
            "m",
            (0.0, 0.005),
            "from the axle to the wheel's centre; bounds assumed",
            example=0.001,
        ),
        strength(
            "phase",
            "rad",
            (-np.pi, np.pi),
            "where that is at a trial's start; 0 = ahead, in the sense of rolling",
            example=0.5,
            scales=False,
        ),
    )

    def _write(self, spec: Any) -> None:
        for side in self.wheels():
            axis = np.array(parts.joint(spec, side).axis)
            ahead = np.array([1.0, 0.0, 0.0])
            down = np.cross(axis / np.linalg.norm(axis), ahead)
            way = np.cos(self["phase"]) * ahead + np.sin(self["phase"]) * down
            for geom in parts.wheel(spec, side).geoms:
                geom.pos += self["offset"] * way


CONE = Choice(
    "cone",
    ("elliptic", "pyramidal"),
    "elliptic",
    "friction alike in all directions, or MuJoCo's pyramid of four sides",
)


class CasterDrag(BodyEffect):
    """The casters drag on the floor instead of rolling.

    Friction is the same in all directions (an elliptic cone). A pyramid of four sides,
    which may do for wheels that roll, turns a robot of dragging casters by a third more
    or less, depending on how it stands in the world; simulations of others have it.
    """

    name = "caster_drag"
    source = "dry friction; the nominal casters have none; bounds assumed"
    choices = (CONE,)
    parameter = strength(
        "friction",
        "1",
        (0.0, 1.0),
        "friction coefficient added; bounds assumed",
        example=0.2,
    )

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: the robot rests on its wheels alone.
        """
        base = parts.base(spec)
        casters = list(parts.contact_geoms(base))
        if not casters:
            raise BnsError(f"Body {base.name!r} rests on its wheels alone: no caster.")
        for geom in casters:
            geom.condim = max(geom.condim, 3)  # 1 has no friction
            geom.friction[0] += self["friction"]
        set_cone(spec, self["cone"])


class MotorLag(ActuatorEffect):
    """The wheels follow their commands with a first-order lag.

    A step from rest has reached 1 - 1/e = 63.2 % at the time constant; a physics step
    is driven at the mean speed over it.
    """

    name = "motor_lag"
    source = "first-order model assumed; the lab's robot loses 0.07-0.14 s from rest"
    choices = (WHEEL,)
    parameter = strength(
        "time_constant",
        "s",
        (0.0, 2.0),
        "time to 63 % of a step; bounds assumed",
        example=0.2,
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        for column in columns(self, signal):
            told = signal.values[:, column]
            for span in spans(active):
                before = told[span.start - 1] if span.start else 0.0  # starts at rest
                told[span] = lagged(
                    told[span], before, self["time_constant"], signal.dt
                )


class WheelBacklash(ActuatorEffect):
    """Play between motor and wheel: travel is lost at each reversal.

    The motor turns as it is told; the wheel stands still while the play is open. A
    trial, or the effect, begins with the play half open either way.
    """

    name = "wheel_backlash"
    source = "play operator (Nordin and Gutman, Automatica 38, 2002); bounds assumed"
    choices = (WHEEL,)
    parameter = strength(
        "play",
        "m",
        (0.0, 0.05),
        "full play at the wheel's rim, angle times radius; bounds assumed",
        example=0.005,
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        half = self["play"] / 2
        for column in columns(self, signal):
            for span in spans(active):
                motor = np.cumsum(signal.values[span, column]) * signal.dt  # [m]
                wheel = _played(motor, half)
                signal.values[span, column] = np.diff(wheel, prepend=0.0) / signal.dt


def _played(motor: np.ndarray, half: float) -> np.ndarray:
    """Travel of what follows with play, ``(S,)``, from the middle of the play."""
    followed, at = np.empty_like(motor), 0.0
    for step, moved in enumerate(motor):
        at = min(max(at, moved - half), moved + half)
        followed[step] = at
    return followed


class BatterySag(ActuatorEffect):
    """The speed reached falls during a trial, with time and with use.

    Every trial starts with a full battery (worlds hold no state between trials); a
    decline over trials is a `wheel_gain` with a ramp.
    """

    name = "battery_sag"
    source = "assumed: speed in proportion to supply, exponential discharge"
    parameters = (
        strength(
            "per_second",
            "1/s",
            (0.0, 0.2),
            "share of the speed lost per second; bounds assumed",
            example=0.01,
        ),
        strength(
            "per_metre",
            "1/m",
            (0.0, 2.0),
            "share of the speed lost per metre told to drive; bounds assumed",
            example=0.05,
        ),
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        speed = np.abs(signal.values).mean(axis=1)  # [m/s] of the two wheels
        rate = self["per_second"] + self["per_metre"] * speed  # [1/s]
        loss = np.where(active, rate * signal.dt, 0.0)
        left = np.exp(-(np.cumsum(loss) - loss))  # at the start of each step
        signal.values[active] *= left[active, None]


class BatteryFade(Fading, ActuatorEffect):
    """The speed reached falls from trial to trial.

    In an experiment the trials since the onset are counted; with a recurrence the
    battery is charged at the start of every period.
    """

    name = "battery_fade"
    source = "assumed: speed in proportion to supply, exponential discharge"

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        signal.values[active] *= self.share
