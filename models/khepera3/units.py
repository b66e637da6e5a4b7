"""Device units of the Khepera III, for both generations of its firmware.

Their conversions differ by a factor of 1.52, so a firmware that is not known is
refused rather than guessed; the robot's answer to `B` tells it.
"""

from dataclasses import dataclass
from math import pi

from bns.errors import UnknownNameError

WHEEL_DIAMETER = 0.041
"""m; nominal (Khepera III manual 2.2, p. 12)"""


@dataclass(frozen=True)
class Firmware:
    """What one generation of the firmware counts in.

    Attributes:
        name: "before-3" or "from-3".
        speed_units: speed units per m/s over the floor.
        counts: encoder counts per turn of a wheel.
        source: of the two.
    """

    name: str
    speed_units: float
    counts: float
    source: str

    def speed(self, units: float) -> float:
        """Speed over the floor [m/s] of a speed in device units."""
        return units / self.speed_units

    def units(self, speed: float) -> float:
        """Device units of a speed over the floor [m/s]; the robot takes whole ones."""
        return speed * self.speed_units

    def angle(self, counts: float) -> float:
        """Angle of a wheel [rad] after so many encoder counts."""
        return counts / self.counts * 2 * pi

    def distance(self, counts: float) -> float:
        """Way over the floor [m] of so many encoder counts, nominal wheel."""
        return self.angle(counts) * WHEEL_DIAMETER / 2

    def encoder(self, distance: float) -> float:
        """Encoder counts of a way over the floor [m], nominal wheel."""
        return distance / (WHEEL_DIAMETER / 2) / (2 * pi) * self.counts


FIRMWARES = {
    "before-3": Firmware(
        "before-3",
        speed_units=144.01e3,
        counts=2764.8,
        source="Khepera III manual 2.2: p. 14 (speed), pp. 12 and 36 (encoder)",
    ),
    "from-3": Firmware(
        "from-3",
        speed_units=218.72e3,
        counts=4198.0,
        source="Sim.I.am, +simiam/+robot/Khepera3.m; one source, not confirmed",
    ),
}


def firmware(version: str | int) -> Firmware:
    """The units of a firmware.

    Args:
        version: "before-3" or "from-3", or the version number that the robot answers
            to `B` (`b,version,revision`).

    Raises:
        UnknownNameError: neither a name nor a positive version number.
    """
    if isinstance(version, int) and not isinstance(version, bool) and version >= 1:
        return FIRMWARES["before-3" if version < 3 else "from-3"]
    if version not in FIRMWARES or isinstance(version, int):
        raise UnknownNameError("Khepera III firmware", str(version), FIRMWARES)
    return FIRMWARES[str(version)]
