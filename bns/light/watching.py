"""What innovations of light following are: of two wheels and of two sensors.

A wheel's miss is that of the way it rolled: half the turn's share less (left) or more
(right) than the forward one; in scaled units the two simply add.
"""

import numpy as np

from bns import detection
from bns.config_watch import WatchConfig
from bns.light.memory import Learned
from bns.light.patterns import Patterns

CHANNELS = ("left wheel", "right wheel", "left sensor", "right sensor")


def innovations(
    motion: Learned,
    moved: Patterns,
    sensors: Learned,
    light: Patterns,
    run: int,
    config: WatchConfig,
) -> np.ndarray:
    """Innovation of each of `CHANNELS` in one trial of a run, ``(4,)``.

    Args:
        motion, sensors: before they are trained on the trial.
        moved, light: the trial's patterns.
        run: which.
        config: thresholds.
    """
    miss, doubt = motion.miss(run, moved), motion.doubt(run, moved)
    usual = motion.spread[run].cpu().numpy()
    ways = np.stack([miss[:, 0] - miss[:, 2], miss[:, 0] + miss[:, 2]], axis=1)
    both = (doubt[:, 0] + doubt[:, 2])[:, None].repeat(2, axis=1)
    rolled = np.full(2, np.hypot(usual[0], usual[2]))
    parts = (
        (motion, moved, ways, both, rolled),
        (
            sensors,
            light,
            sensors.miss(run, light),
            sensors.doubt(run, light),
            sensors.spread[run].cpu().numpy(),
        ),
    )
    found = []
    for part, patterns, *expected in parts:
        learned = part.buffer.inputs[run]
        known = detection.familiar(patterns.inputs, learned, config)
        found.append(detection.innovation(*expected, known, config))
    return np.concatenate(found)
