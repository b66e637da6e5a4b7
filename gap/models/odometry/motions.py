"""Motions of a sensor on a robot with two wheels, and what wheels and mount predict."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bns.errors import BnsError
from bns.worlds.data.units import wrapped
from bns.worlds.trial import Trial, body_displacements

NUMBERS = (
    "axle",
    "left_diameter",
    "right_diameter",
    "sensor_scale",
    "mount_x",
    "mount_y",
    "mount_angle",
    "length_bias",
)
"""What a prediction depends on, as changes of nominal: the first four relative, then
the sensor's place [m, m] and heading [rad] on the robot, and an error of the sensor's
lengths along the travel, per interval [m]."""

TURN = NUMBERS.index("mount_angle")
STILL = 1e-3  # [m] an interval with less way has no length to be wrong; assumed


@dataclass(frozen=True, eq=False)
class Motions:
    """Relative motions of a sensor, and the wheel motions beside them.

    Attributes:
        left, right: way of each wheel at nominal diameters, shape ``(K,)`` [m].
        seen: motion of the sensor in its own frame, ``(K, 3)`` [m, m, rad].
        axle: nominal distance of the wheels [m].
    """

    left: np.ndarray
    right: np.ndarray
    seen: np.ndarray
    axle: float

    @classmethod
    def of(cls, trial: Trial, *, axle: float) -> "Motions":
        """From a trial whose commands are the wheels' speeds.

        Raises:
            BnsError: the commands are not wheel speeds.
        """
        names = [channel.name for channel in trial.commands.channels]
        if names != ["left_speed", "right_speed"]:
            raise BnsError(
                "Odometry needs the commands left_speed and right_speed; the trial "
                f"has {', '.join(names)}."
            )
        ways = trial.commands.values * trial.commands.durations[:, None]
        seen = body_displacements(trial.command_poses_world)
        return cls(ways[:, 0], ways[:, 1], seen, axle)

    @classmethod
    def joined(cls, parts: "list[Motions]") -> "Motions":
        """Motions of one robot, recorded at several times, as one."""
        left, right, seen = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("left", "right", "seen")
        )
        return cls(left, right, seen, parts[0].axle)

    def __len__(self) -> int:
        return len(self.left)

    def take(self, chosen: np.ndarray) -> "Motions":
        """Some of the intervals, by index or mask ``(K,)``."""
        return Motions(
            self.left[chosen], self.right[chosen], self.seen[chosen], self.axle
        )

    def predict(self, values: np.ndarray) -> np.ndarray:
        """Motions of the sensor in its own frame, ``(K, 3)`` [m, m, rad].

        The sensor at p, turned by a on the robot, moves by ``R(-a) (chord + (R(turn) -
        I) p)`` while the robot drives a chord and turns (Censi et al., IEEE TRO 29(2),
        2013, eq. 4). The turn is as driven, not wrapped.

        Args:
            values: changes of `NUMBERS`; zeros are nominal.
        """
        axle, left, right, scale, x, y, angle, bias = values
        way, turn = self.driven(left, right, axle)
        told = self.driven()[0]
        sign = np.sign(told) * (np.abs(told) > STILL)
        chord = (1 + scale) * way * np.sinc(turn / (2 * np.pi)) + bias * sign
        cos, sin = np.cos(turn) - 1, np.sin(turn)
        dx = chord * np.cos(turn / 2) + (1 + scale) * (cos * x - sin * y)
        dy = chord * np.sin(turn / 2) + (1 + scale) * (sin * x + cos * y)
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([c * dx + s * dy, c * dy - s * dx, turn], axis=1)

    def driven(
        self, left: float = 0.0, right: float = 0.0, axle: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Way of the axle's middle [m] and turn [rad], each ``(K,)``.

        Args:
            left: relative change of the left wheel's way.
            right: relative change of the right wheel's way.
            axle: relative change of the axle's length.
        """
        ways = (1 + left) * self.left, (1 + right) * self.right
        return (ways[0] + ways[1]) / 2, (ways[1] - ways[0]) / ((1 + axle) * self.axle)

    def rest(self, values: np.ndarray) -> np.ndarray:
        """Seen minus predicted, ``(K, 3)``, turns within half a turn [m, m, rad]."""
        made = self.seen - self.predict(values)
        made[:, 2] = wrapped(made[:, 2])
        return made

    def slopes(self, values: np.ndarray) -> np.ndarray:
        """Derivatives of `predict` by each number, ``(8, K, 3)``; differences."""
        steps = 1e-6 * np.eye(len(NUMBERS))
        ahead = np.stack([self.predict(values + step) for step in steps])
        return (ahead - self.predict(values)) / 1e-6


def changed(magnitudes: Mapping[str, float]) -> np.ndarray:
    """Changes of `NUMBERS` in their order, ``(K,)``, from those that are not zero.

    Raises:
        ValueError: a name that is none of `NUMBERS`.
    """
    values = np.zeros(len(NUMBERS))
    for name, magnitude in magnitudes.items():
        values[NUMBERS.index(name)] = magnitude
    return values


ROUNDS = 15  # of the weights of `start`


def start(motions: Motions) -> np.ndarray:
    """Changes of `NUMBERS` in closed form, at any heading of the sensor.

    Turns are linear in the wheels' ways. With turns known, the sensor's motions are
    linear in ``r cos(a), r sin(a)`` (r: way over nominal way) and in ``R(-a) p``: two
    linear fits with weights that forgive lost matches, no first guess needed.
    """
    nominal = motions.driven()[1]
    turned = nominal + wrapped(motions.seen[:, 2] - nominal)
    columns = np.stack([-motions.left, motions.right], axis=1) / motions.axle
    left, right = robust(columns, turned)
    way, turn = motions.driven(left - 1, right - 1)
    chord = way * np.sinc(turn / (2 * np.pi))
    ahead, aside = chord * np.cos(turn / 2), chord * np.sin(turn / 2)
    cos, sin = np.cos(turn) - 1, np.sin(turn)
    rows = np.concatenate(
        [np.stack([ahead, aside, cos, -sin], 1), np.stack([aside, -ahead, sin, cos], 1)]
    )
    c, s, u, v = robust(rows, motions.seen[:, :2].T.ravel())
    size = np.hypot(c, s)
    cos, sin = (c / size, s / size) if size > 0 else (1.0, 0.0)
    x, y = cos * u - sin * v, sin * u + cos * v
    return np.array([0, left - 1, right - 1, 0, x, y, np.arctan2(sin, cos), 0.0])


def robust(columns: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Linear fit with Cauchy's weights, their scale the median of the rest's size.

    Args:
        columns: ``(N, K)``.
        target: ``(N,)``.

    Returns:
        factors of the columns, ``(K,)``.
    """
    weight = np.ones(len(target))
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        found = np.linalg.lstsq(columns * root[:, None], target * root, None)[0]
        rest = np.abs(target - columns @ found)
        weight = 1 / (1 + (rest / max(2 * np.median(rest), 1e-9)) ** 2)
    return found
