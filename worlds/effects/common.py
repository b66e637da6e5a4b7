"""What several effects share: wheel columns, spans of time, limits of the drive."""

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
