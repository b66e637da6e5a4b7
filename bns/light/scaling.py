"""Units of light following, scaled to about -1..1 for the networks.

Motion SNN: previous left and right wheel speed, new left and right wheel speed ->
forward, left, turn in the body frame. Sensor SNNs: bearing and distance of the lamp ->
brightness left and right. A cycle has always the same duration, so it is no input.
"""

from dataclasses import dataclass

from bns.light.controller import Controllers, Numbers

DARK = 4095.0  # [counts] reading in the dark, 12 bits (Khepera III test program)
AXLE = 0.0884  # [m] Khepera III axle, only to scale the turn (not fitted)
FAR = 1.0  # [m] distance of the lamp that is scaled to 1; assumed
MOTION_INPUTS, MOTION_OUTPUTS = 4, 3
SENSORS = 2


def brightness(counts: Numbers) -> Numbers:
    """Readings (smaller is brighter) as 0 in the dark to 1 in full light."""
    return (DARK - counts) / DARK


def counts(bright: Numbers) -> Numbers:
    """The reading of a brightness."""
    return DARK * (1 - bright)


@dataclass(frozen=True)
class Scales:
    """Scales of the motion SNN.

    Attributes:
        speed: largest wheel speed [m/s].
        moved: of forward, left [m] and turn [rad].
    """

    speed: float
    moved: tuple[float, float, float]

    @classmethod
    def of(cls, controllers: Controllers, cycle: float) -> "Scales":
        """For the speeds of some controllers, held for `cycle` seconds."""
        speed = max(abs(controllers.slowest), abs(controllers.fastest))
        way = speed * cycle
        return cls(speed, (way, way, 2 * way / AXLE))
