"""Whether a hexapod rests: nothing that is read or seen of it changes any more."""

import numpy as np

UNITS, MOVED, TURNED = 2, 0.002, np.deg2rad(0.5)
"""changes that count as motion: of a servo [units], of the robot [m], [rad]"""


class Rest:
    """Since when nothing has moved.

    Attributes:
        since: time of the newest change [s].
    """

    def __init__(self) -> None:
        self.since = 0.0
        self._units: dict[int, int] = {}
        self._pose = np.full(3, np.inf)

    def again(self, now: float) -> None:
        """A new goal: motion is to be expected."""
        self.since = now

    def servo(self, number: int, units: int, now: float) -> None:
        """A servo's position was read.

        Args:
            number: of the servo.
            units: its position [position units].
            now: time of the reading [s].
        """
        if abs(units - self._units.get(number, -9)) > UNITS:
            self._units[number], self.since = units, now

    def pose(self, pose: np.ndarray, now: float) -> None:
        """The robot was seen."""
        off = np.abs(pose - self._pose)
        if np.hypot(*off[:2]) > MOVED or off[2] > TURNED:
            self._pose, self.since = pose, now
