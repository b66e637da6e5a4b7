"""From commands to set points: the software damage applied, the changes kept."""

import numpy as np

from bns.hardware.driving.motion import Point
from bns.worlds.active import Stages
from bns.worlds.physics import control
from bns.worlds.trial import Commands

GRID = 0.02  # s; effects are computed on it
SPACING = 0.1  # s between two set points within a command, at least
STEP = 0.002  # m/s; smaller changes are not sent


def points(commands: Commands, stages: Stages, seed: int, trial: int) -> list[Point]:
    """Set points of a trial.

    Args:
        commands: what the learner wants.
        stages: effects of the command and actuator stages act on it.
        seed, trial: of their generators.
    """
    counts = control.steps(commands.durations, GRID)
    signal = control.signal(commands, counts, GRID)
    values = control.disturbed(signal, stages.control, seed, trial)
    begins = np.concatenate([[0.0], np.cumsum(commands.durations)])
    parts = np.split(values, np.cumsum(counts)[:-1])
    spans = zip(parts, begins, begins[1:], strict=False)
    return [
        point
        for index, (part, begin, end) in enumerate(spans)
        for point in within(part, begin, end, index)
    ]


def within(values: np.ndarray, begin: float, end: float, command: int) -> list[Point]:
    """Set points of one command.

    Args:
        values: left and right on the grid, ``(S, 2)`` [m/s].
        begin, end: of the command [s].
        command: its index.
    """
    made = [Point(float(begin), float(values[0, 0]), float(values[0, 1]), command)]
    for step in range(1, len(values)):
        moment, new = begin + step * GRID, values[step]
        before = made[-1]
        far = max(abs(new[0] - before.left), abs(new[1] - before.right)) > STEP
        near_end = moment > end - SPACING
        if far and moment - before.at >= SPACING - 1e-9 and not near_end:
            made.append(Point(float(moment), float(new[0]), float(new[1]), -1))
    return made
