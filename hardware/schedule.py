"""From commands to set points: the software damage applied, the changes kept."""

import numpy as np

from bns.hardware.motion import Point
from bns.worlds import control
from bns.worlds.active import Stages
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
    made: list[Point] = []
    at = 0
    for index, count in enumerate(counts):
        part = values[at : at + count]
        made.append(Point(begins[index], *map(float, part[0]), index))
        for step in range(1, count):
            moment = begins[index] + step * GRID
            before, new = made[-1], part[step]
            far = max(abs(new[0] - before.left), abs(new[1] - before.right)) > STEP
            near_end = moment > begins[index + 1] - SPACING
            if far and moment - before.at >= SPACING - 1e-9 and not near_end:
                made.append(Point(float(moment), float(new[0]), float(new[1]), -1))
        at += count
    return made
