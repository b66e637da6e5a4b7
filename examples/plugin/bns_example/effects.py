"""An effect: one wheel slips on its axle."""

import numpy as np

from bns.worlds.effects.base import CommandEffect, ControlSignal, strength


class LooseWheel(CommandEffect):
    """The left wheel slips on its axle at the start of every command."""

    name = "loose_wheel"
    doc = "the left wheel slips at the start of every command"
    source = "assumed"
    parameter = strength(
        "slip",
        "s",
        (0.0, 2.0),
        "time constant of the slip; bounds assumed",
        example=0.3,
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        """Let the speed of the left wheel come up slowly in each command."""
        _, first, which = np.unique(
            signal.command, return_index=True, return_inverse=True
        )
        since = signal.times - signal.times[first][which]
        share = 1.0 - np.exp(-since / self["slip"])
        signal.values[active, signal.column("left_speed")] *= share[active]
