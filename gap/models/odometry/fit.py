"""Which part of a differential drive's odometry is wrong? From relative motions alone.

Wheel speeds, integrated over an interval with the nominal wheels and axle, predict how
the robot moves and, through its mount, how a sensor on it moves. What the sensor saw
instead is explained by a few candidates. The motions are so short that the sensor's own
errors of length matter: a common error of lengths per interval, `LENGTH_BIAS`, is part
of the noise and does not average out. This is what makes wheels that are too large and
an axle that is too short alike, until a long drive is measured as a whole.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bns.errors import BnsError
from bns.worlds.trial import Trial, body_displacements

CANDIDATES: Mapping[str, tuple[str, ...]] = {
    "axle": ("axle",),
    "both_diameters": ("left_diameter", "right_diameter"),
    "left_diameter": ("left_diameter",),
    "right_diameter": ("right_diameter",),
    "mount_x": ("mount_x",),
    "mount_y": ("mount_y",),
    "mount_angle": ("mount_angle",),
}
"""Candidates and the numbers that each of them moves."""

NUMBERS = (
    "axle",
    "left_diameter",
    "right_diameter",
    "mount_x",
    "mount_y",
    "mount_angle",
)
RATIOS = ("axle", "left_diameter", "right_diameter")
"""given as factors of nominal; the others are added"""

LENGTH_BIAS = 2e-4  # [m] per interval, common to all: scan matching; assumed
STILL = 1e-3  # [m] an interval with less way has no length to be wrong; assumed
CLIP = 4.0  # deviations beyond which a residual counts no more
BLOCK = 50  # intervals that are held out together


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

    def __len__(self) -> int:
        return len(self.left)

    def take(self, chosen: np.ndarray) -> "Motions":
        """Some of the intervals."""
        return Motions(
            self.left[chosen], self.right[chosen], self.seen[chosen], self.axle
        )

    def predict(self, values: np.ndarray) -> np.ndarray:
        """Motions of the sensor, ``(K, 3)``.

        Args:
            values: of `NUMBERS`: factors and additions; ones and zeros are nominal.
        """
        axle, left, right, x, y, angle = values
        way = (left * self.left + right * self.right) / 2
        turn = (right * self.right - left * self.left) / (axle * self.axle)
        chord = way * np.sinc(turn / (2 * np.pi))
        cos, sin = np.cos(turn), np.sin(turn)
        dx = chord * np.cos(turn / 2) + cos * x - sin * y - x
        dy = chord * np.sin(turn / 2) + sin * x + cos * y - y
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([c * dx + s * dy, c * dy - s * dx, turn], axis=1)


NOMINAL = np.array([1.0 if name in RATIOS else 0.0 for name in NUMBERS])


def changed(magnitudes: Mapping[str, float]) -> np.ndarray:
    """Values of `NUMBERS` under candidates: factors multiply, the others add."""
    values = NOMINAL.copy()
    for name, magnitude in magnitudes.items():
        for number in CANDIDATES[name]:
            at = NUMBERS.index(number)
            values[at] += magnitude
    return values


@dataclass(frozen=True, eq=False)
class Noise:
    """What motions scatter by.

    Attributes:
        deviation: of one interval, per channel, robust, shape ``(3,)``.
        length_bias: see `LENGTH_BIAS` [m].
    """

    deviation: np.ndarray
    length_bias: float = LENGTH_BIAS

    def whiten(self, motions: Motions, rest: np.ndarray) -> np.ndarray:
        """Residuals (or columns of derivatives) in deviations, ``(..., K, 3)``.

        The bias of lengths has one known shape, the direction of travel; its part of
        the residuals is shrunk as its variance demands.
        """
        scaled = rest / self.deviation
        way = (motions.left + motions.right) / 2
        shape = np.sign(way) * (np.abs(way) > STILL)
        norm = np.sqrt((shape**2).sum())
        if norm == 0 or self.length_bias == 0:
            return scaled
        unit = shape / norm
        strength = (self.length_bias / self.deviation[0]) * norm
        keep = 1.0 / np.sqrt(1.0 + strength**2)
        along = scaled[..., 0] @ unit
        scaled = scaled.copy()
        scaled[..., 0] -= (1 - keep) * along[..., None] * unit
        return scaled


def noise_of(motions: Motions, *, length_bias: float = LENGTH_BIAS) -> Noise:
    """Noise from residuals of a fit of all numbers, by the median of magnitudes."""
    rest = motions.seen - motions.predict(NOMINAL)
    deviation = 1.4826 * np.median(np.abs(rest - np.median(rest, axis=0)), axis=0)
    for _ in range(3):
        fitted = fit(motions, NUMBERS_ALL, Noise(deviation, 0.0))
        rest = motions.seen - motions.predict(changed(fitted.magnitudes))
        deviation = 1.4826 * np.median(np.abs(rest), axis=0)
    return Noise(deviation, length_bias)


NUMBERS_ALL = ("axle", "left_diameter", "right_diameter", "mount_x", "mount_y")
NUMBERS_ALL += ("mount_angle",)


@dataclass(frozen=True, eq=False)
class OdometryFit:
    """Candidates fitted to motions.

    Attributes:
        magnitudes: of each candidate: factor minus 1, or what is added.
        deviations: one standard deviation of each.
        cost: clipped sum of squared deviations.
        signatures: whitened derivative by each candidate, ``(n, 3 K)``.
    """

    magnitudes: Mapping[str, float]
    deviations: Mapping[str, float]
    cost: float
    signatures: np.ndarray


def fit(motions: Motions, names: Sequence[str], noise: Noise) -> OdometryFit:
    """Fit candidates together: Gauss-Newton with Tukey weights.

    Args:
        motions: to explain.
        names: of the candidates; none = nominal.
        noise: of the motions.
    """
    point = np.zeros(len(names))
    jacobian = np.zeros((len(names), 3 * len(motions)))
    for _ in range(12):
        values = changed(dict(zip(names, point, strict=True)))
        rest = noise.whiten(motions, motions.seen - motions.predict(values))
        weight = _weight(motions, values, noise)
        if not len(names):
            break
        steps = 1e-6 * np.eye(len(names))
        moved = [
            motions.predict(changed(dict(zip(names, point + s, strict=True))))
            for s in steps
        ]
        slopes = (np.stack(moved) - motions.predict(values)) / 1e-6
        jacobian = noise.whiten(motions, slopes).reshape(len(names), -1)
        weighted = jacobian * weight.ravel()
        move = np.linalg.lstsq(weighted @ jacobian.T, weighted @ rest.ravel(), None)[0]
        point = point + move
        if np.abs(move).max() < 1e-9:
            break
    normal = (jacobian * weight.ravel()) @ jacobian.T
    spread = np.sqrt(np.diag(np.linalg.pinv(normal))) if len(names) else point
    return OdometryFit(
        dict(zip(names, point.tolist(), strict=True)),
        dict(zip(names, spread.tolist(), strict=True)),
        cost(motions, dict(zip(names, point, strict=True)), noise),
        jacobian,
    )


def cost(motions: Motions, magnitudes: Mapping[str, float], noise: Noise) -> float:
    """Sum of squared deviations, each clipped at `CLIP`, lost matches thus bounded."""
    values = changed(magnitudes)
    plain = (motions.seen - motions.predict(values)) / noise.deviation
    clipped = np.clip(plain, -CLIP, CLIP) * noise.deviation
    return float((noise.whiten(motions, clipped) ** 2).sum())


def _weight(motions: Motions, values: np.ndarray, noise: Noise) -> np.ndarray:
    plain = (motions.seen - motions.predict(values)) / noise.deviation
    return np.clip(1 - (plain / (1.5 * CLIP)) ** 2, 0.0, None) ** 2
