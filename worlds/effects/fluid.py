"""The medium that a robot moves in: water, or air."""

from typing import Any, ClassVar

from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, factor


class _FluidNumber(BodyEffect):
    """A number of the model's medium is scaled."""

    robots = ("own",)
    choices = parts.part("model")
    field: ClassVar[str]

    def _write(self, spec: Any) -> None:
        parts.among((parts.ALL,), self["part"], "part that has a medium")
        value = getattr(spec.option, self.field) * self["factor"]
        setattr(spec.option, self.field, value)


class FluidDensity(_FluidNumber):
    """What the robot moves in is denser than the model says, or its drag is larger."""

    name, field = "fluid_density", "density"
    source = "MuJoCo's fluid forces: drag and lift in proportion to density"
    parameter = factor((0.0, 10.0), "density over the model's", example=1.5)


class FluidViscosity(_FluidNumber):
    """What the robot moves in is more viscous than the model says."""

    name, field = "fluid_viscosity", "viscosity"
    source = "MuJoCo's fluid forces: Stokes drag in proportion to viscosity"
    parameter = factor((0.0, 10.0), "viscosity over the model's", example=1.5)
