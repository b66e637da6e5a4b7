"""An effect: one wheel slips on its axle."""

import numpy as np

from bns.worlds.effects.base import CommandEffect, ControlSignal, Parameter


class LooseWheel(CommandEffect):
    """The left wheel slips on its axle at the start of every command."""

    name = "loose_wheel"
    doc = "the left wheel slips at the start of every command"
    source = "assumed"
    parameters = (
        Parameter(
            "slip",
            unit="s",
            nominal=0.0,
            low=0.0,
            high=2.0,
            doc="time constant of the slip; bounds assumed",
            example=0.3,
        ),
    )

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Let the speed of the left wheel come up slowly in each command."""
        values = signal.values.copy()
        if self["slip"] == 0.0:  # nominal: change nothing, bit for bit
            return values
        _, first, which = np.unique(
            signal.command, return_index=True, return_inverse=True
        )
        since = signal.times - signal.times[first][which]
        share = 1.0 - np.exp(-since / self["slip"])
        values[active, signal.column("left_speed")] *= share[active]
        return values
