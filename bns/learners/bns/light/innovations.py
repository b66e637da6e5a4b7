"""What innovations of light following are: of two wheels and of two sensors.

A wheel's miss is that of the way it rolled: half the turn's share less (left) or more
(right) than the forward one; in scaled units the two simply add.
"""

import numpy as np

from bns.learners.bns.change_detection import Ground, Misses, innovation
from bns.learners.bns.config import WatchConfig
from bns.learners.bns.memory import Memory, Patterns

CHANNELS = ("left wheel", "right wheel", "left sensor", "right sensor")


def innovations(
    motion: Memory,
    moved: Patterns,
    sensors: Memory,
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
    turned = motion.spread[run].cpu().numpy()
    variance = motion.variance(run, moved)
    wheels = Misses(
        _ways(motion.error(run, moved)),
        (variance[:, 0] + variance[:, 2])[:, None].repeat(2, axis=1),
        _ways(motion.error(run, motion.patterns(run))),
        np.full(2, np.hypot(turned[0], turned[2])),
    )
    eyes = Misses(
        sensors.error(run, light),
        sensors.variance(run, light),
        sensors.error(run, sensors.patterns(run)),
        sensors.spread[run].cpu().numpy(),
    )
    rolled = Ground.of(moved.inputs, motion.buffer.inputs[run], config)
    seen = Ground.of(_places(light.inputs), _places(sensors.buffer.inputs[run]), config)
    return np.concatenate(
        [innovation(wheels, rolled, config), innovation(eyes, seen, config)]
    )


def _ways(miss: np.ndarray) -> np.ndarray:
    """Misses of the left and the right wheel's way."""
    return np.stack([miss[:, 0] - miss[:, 2], miss[:, 0] + miss[:, 2]], axis=1)


def _places(views: np.ndarray) -> np.ndarray:
    """Inputs of the sensor SNNs with the logarithm of the lamp's distance.

    Light falls off with the square of the distance: a step towards the lamp changes a
    reading by the share of the way that is left.
    """
    return np.column_stack([views[:, :-1], np.log(views[:, -1])])
