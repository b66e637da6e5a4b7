"""Commands that arrive late."""

import numpy as np

from bns.worlds.effects.base import CommandEffect, ControlSignal, strength


class CommandLatency(CommandEffect):
    """Commands reach the motors late.

    A delay that is no multiple of the physics step is met on average: a step in which
    the command changes gets the time-weighted mean of the two.
    """

    name = "command_latency"
    source = "0.2 s fits the MRCLAM 6 robots best; bounds assumed"
    robots = ("wheeled", "legged")
    parameters = (
        strength("delay", "s", (0.0, 2.0), "time from command to motor", example=0.2),
    )

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """See `CommandEffect.apply`."""
        values = signal.values.copy()
        if self.is_nominal:
            return values
        steps = self["delay"] / signal.dt
        whole = int(np.floor(steps + 1e-9))  # rounding must not cost a step
        share = max(steps - whole, 0.0)
        late = _shifted(signal.values, whole)
        if share > 1e-9:
            late = (1 - share) * late + share * _shifted(signal.values, whole + 1)
        values[active] = late[active]
        return values


def _shifted(values: np.ndarray, steps: int) -> np.ndarray:
    late = np.zeros_like(values)
    if steps < len(values):
        late[steps:] = values[: len(values) - steps]
    return late
