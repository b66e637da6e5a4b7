"""What effects share: wheel columns, spans of time, limits of the drive, lags."""

from collections.abc import Iterator

import numpy as np

from bns.worlds.effects.base import Choice, ControlSignal, Effect

# [m/s per speed unit] Khepera III manual 2.2, p. 14 (firmware < 3): 144.01 units
# to the mm/s.
SPEED_UNIT = 1e-3 / 144.01
# [m/s] Same page: largest speed in open loop, 48,000 units.
TOP_SPEED = 0.3334  # 48,000 units are 0.33331 m/s
# [m/s] Smallest speed that the lab's controllers use, 8,000 units; below it a speed
# gene means stop.
MINIMUM_SPEED = round(8000 * SPEED_UNIT, 6)
# [m/s] Largest speed that the lab's controllers use, 17,500 units.
MAXIMUM_SPEED = round(17500 * SPEED_UNIT, 6)

WHEEL = Choice("wheel", ("left", "right", "both"), "both", "which wheel is affected")


def columns(effect: Effect, signal: ControlSignal) -> list[int]:
    """Columns of the signal that the effect's choice `wheel` names."""
    return [signal.column(f"{wheel}_speed") for wheel in effect.wheels()]


def spans(active: np.ndarray) -> Iterator[slice]:
    """Contiguous stretches where `active`, ``(T,)``, is true, as slices in order."""
    edges = np.flatnonzero(np.diff(active.astype(np.int8), prepend=0, append=0))
    for start, stop in edges.reshape(-1, 2):
        yield slice(int(start), int(stop))


def rarer(effect: Effect, severity: float) -> int:
    """The parameter `every` at a severity: half of it hits half as often; 0 = never."""
    every = int(effect["every"])
    if severity <= 0 or every <= 0:
        return 0
    every = round(every / severity)
    return every if every <= effect.parameters[0].high else 0


def lagged(
    told: np.ndarray, before: float, time_constant: float, dt: float
) -> np.ndarray:
    """What follows a signal as a first-order lag, its mean over each step, ``(S,)``.

    Solved exactly for values that are constant over a step. The mean is late by the
    time constant at any step; the value at a step's end would be early by half a step.

    Args:
        told: values, ``(S,)``.
        before: value that was followed until then.
        time_constant: [s], positive.
        dt: step [s].
    """
    from scipy.signal import lfilter

    keep = np.exp(-dt / time_constant)
    begun = lfilter([0.0, 1 - keep], [1.0, -keep], told, zi=[before])[0]
    return told + (begun - told) * (1 - keep) * time_constant / dt
