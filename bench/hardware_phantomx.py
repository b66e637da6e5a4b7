"""The hexapod's bus in real time: goals out, states in, and on time."""

import os

import numpy as np

from bench._hardware import emulator, folder
from bench.result import Result

DOC = "18 servos on an emulated port: a sync write each 30 ms, two states read between"
BAR = "a walk learned over 20 trials, damage applied; <= 5 % deadlines missed"
PERIOD = 0.03  # s; the maker's frame is 33 ms
LATE = 0.005  # s after its moment at which a goal counts as missed
SECONDS = 120.0


def run(quick: bool) -> Result:
    """The figure is the share of goals sent late; the bar's walk is not part of it.

    The servos follow a simple law without a body, so nothing can be learned on them:
    the walk over the bus is not measured here, and the bar does not hold.
    """
    from bns.hardware.clock import RealClock
    from bns.hardware.dynamixel import joints
    from bns.hardware.dynamixel.bus import Bus
    from bns.hardware.leash import Leash
    from bns.hardware.priority import urgent

    clock, seconds = RealClock(), 10.0 if quick else SECONDS
    kind = urgent()
    with folder() as path, emulator(path / "bus", robot="phantomx"):
        bus = Bus(str(path / "bus"), joints.read(), clock)
        leash = Leash(bus.fileno(), str(path / "bus"), 1_000_000, "phantomx")
        bus.guard = leash
        try:
            bus.identify()
            bus.torque(True)
            late, trips = _walk(bus, clock, round(seconds / PERIOD))
        finally:
            bus.close()
            leash.release()
    missed = float((late > LATE).mean())
    return Result(
        figure=round(100 * missed, 3),
        unit="% missed",
        holds=False,
        n=len(late),
        details={
            "walk learned": None,
            "deadlines hold": missed <= 0.05,
            "late p50, p99, max [ms]": _spread(late),
            "goals and two reads p50, p99, max [ms]": _spread(trips),
            "faults": dict(bus.faults.counts),
            "precedence": kind,
            "load of the machine (1 min)": round(os.getloadavg()[0], 1),
        },
    )


def _walk(bus, clock, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Wave all joints; lateness of each goal and time of each frame's traffic [s]."""
    late, trips = np.zeros(frames), np.zeros(frames)
    begin = clock.now() + 0.1
    for frame in range(frames):
        due = begin + frame * PERIOD
        clock.sleep(due - clock.now())
        late[frame] = clock.now() - due
        angle = 0.3 * np.sin(2 * np.pi * frame * PERIOD)
        bus.write({joint.name: angle for joint in bus.joints})
        bus.look(2)
        trips[frame] = clock.now() - due - late[frame]
    return late, trips


def _spread(values: np.ndarray) -> list[float]:
    return [round(float(v) * 1e3, 3) for v in np.quantile(values, [0.5, 0.99, 1.0])]
