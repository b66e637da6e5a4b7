"""Torque limit: a wheel's motor is weaker than in the model."""

from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.common import WHEEL

LEAST = 1e-9  # of the torque; MuJoCo takes a range of nothing for no limit at all


class TorqueLimit(BodyEffect):
    """The largest torque of a wheel's motor is scaled."""

    name = "torque_limit"
    doc = "a wheel's motor is weaker than in the model"
    source = "nominal 0.057 N m: Webots Khepera3; bounds assumed"
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.0,
            high=1.0,
            doc="largest torque over the model's",
            example=0.02,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        for side in self.wheels():
            motor = bodies.actuator(spec, side)
            if not motor.forcerange.any():
                raise BnsError(
                    f"Actuator {motor.name!r} has no force range to scale: give it a "
                    "`forcerange` in the model."
                )
            share = max(self["factor"], LEAST)
            motor.forcerange = np.asarray(motor.forcerange) * share
