"""Define an effect of your own and damage a robot with it.

    python examples/05_own_effect.py

In the package an effect is a class in `worlds/effects/`, found by its name. Outside,
an object of the class does: worlds take it wherever they take an effect as text.
"""

import argparse

import numpy as np

from bns.worlds import registry
from bns.worlds.damage import Damage, Event
from bns.worlds.effects.base import CommandEffect, ControlSignal, strength
from bns.worlds.trial import Commands


class LooseWheel(CommandEffect):
    """The left wheel slips at the start of every command."""

    name = "loose_wheel"
    source = "assumed"
    parameter = strength(
        "slip",
        "s",
        (0.0, 2.0),
        "time constant of the slip; bounds assumed",
        example=0.3,
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        """Let the speed of the left wheel come up slowly in each command.

        It is asked only where the slip is not nominal, and changes a copy.
        """
        _, first, which = np.unique(
            signal.command, return_index=True, return_inverse=True
        )
        since = signal.times - signal.times[first][which]
        share = 1.0 - np.exp(-since / self["slip"])
        signal.values[active, signal.column("left_speed")] *= share[active]


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--quick", action="store_true", help="one strength only")
strengths = (0.2,) if parser.parse_args().quick else (0.0, 0.1, 0.2, 0.4)

commands = Commands(np.full((3, 2), 0.12), np.full(3, 1.0))  # straight, [m/s], [s]
for slip in strengths:
    # From trial 2 on, as `@2` would say in text.
    damage = Damage((Event(LooseWheel({"slip": slip}), onset_trial=2),))
    world = registry.make("mujoco", robot="khepera3", damage=damage)
    for trial in (1, 2):
        (done,) = world.run([commands], trial=trial)
        x, y, yaw = done.poses_world[-1]
        print(
            f"{damage.texts()[0]:26} trial {trial}: ends at ({x:.3f}, {y:.3f}) m, "
            f"turned {np.degrees(yaw):.0f} deg; record: {done.conditions['damage']}"
        )
