"""What of the time to a standstill is the robot's own.

The emulated body alone, without line, driver, watchdog or log, in virtual time.
"""

from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise

import numpy as np

from bench.hardware.drives import SPEEDS
from bns.hardware.emulators.hexapod_body import HexapodBody
from bns.hardware.emulators.khepera_body import KheperaBody
from bns.hardware.emulators.live_body import LiveBody
from bns.hardware.emulators.run import SLOW

ROUND = 0.0045  # s between two looks, as in the emulator's log
SINKS, LASTS = 0.3, 0.1  # s until a hexapod sinks, s that rest lasts
BLUR = 0.02  # s by which a log may take a moment's rest for longer than it was
STEADY, ENDS = 2.0, 2.0  # s of driving before; s after which it stands


@cache
def khepera3() -> float:
    """Time in which wheels told to stand do so, from the speeds of the bench [s]."""
    body = KheperaBody()
    body.tell(0.0, *SPEEDS)
    body.advance(STEADY)
    body.tell(STEADY, 0.0, 0.0)
    return _time(body, lambda: max(map(abs, body.wheel_speeds())) < SLOW)


def phantomx(state: Sequence[float]) -> float:
    """Time in which a hexapod without torque comes to rest [s].

    Args:
        state: of the physics, when the torque goes.
    """
    body = HexapodBody()
    for on in (True, False):
        for number in body.joints:
            body.power(number, on)
    body.state = np.array(state)
    return _time(body, body.rests, sinks=True)


def came_to_rest(
    rows: Sequence[tuple[float, bool]],
    begin: float,
    *,
    sinks: bool,
    lasts: float = LASTS,
) -> float | None:
    """When a robot has come to rest after it was told to [s]; None: not yet.

    Args:
        rows: when it began to stand or to move [s], and whether it stands.
        begin: when it was told to stand [s].
        sinks: it stands on its legs when it is told, and sinks a moment later.
        lasts: how long rest has to last to be rest [s].
    """
    state = next((stands for at, stands in reversed(rows) if at <= begin), True)
    later = [row for row in rows if row[0] > begin]
    sinks = sinks and any(at < begin + SINKS for at, stands in later if not stands)
    if state and not sinks:
        return begin
    for (at, stands), (end, _) in pairwise([*later, (np.inf, False)]):
        if stands and end - at > lasts:
            return at
    return None


def _time(body: LiveBody, stands: Callable[[], bool], *, sinks: bool = False) -> float:
    """From now to rest [s]."""
    begin = body.now
    rows = [(begin, stands())]
    for at in np.arange(begin + ROUND, begin + ENDS, ROUND):
        body.advance(at)
        if stands() != rows[-1][1]:
            rows.append((float(at), stands()))
    found = came_to_rest(rows, begin, sinks=sinks, lasts=LASTS + BLUR)
    return np.inf if found is None else found - begin
