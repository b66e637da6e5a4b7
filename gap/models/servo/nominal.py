"""A nominal servo law, fitted to runs whose settings are known."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bns.errors import BnsError, UnknownNameError
from bns.gap.models.servo.runs import Runs
from bns.gap.recordings.trial_conditions import SERVO
from bns.models import servo_pendulum, xl330
from bns.worlds.physics.servo_law import NUMBERS, Law, law
from bns.worlds.physics.servo_rollout import simulate

FREE = (
    "torque_constant",
    "resistance",
    "armature",
    "gyration",
    "coulomb",
    "viscous",
    "load_friction",
    "stribeck",
    "stribeck_speed",
    "delay",
    "offset",
    "duty_limit",
)
"""What a fit adjusts: what a data sheet does not say of one servo."""

SERVOS = {"sts3215": servo_pendulum.law, "xl330": xl330.law}
"""laws by what recordings call their servo, in the condition `servo`"""
USUAL = "sts3215"  # where they do not say it
NOT_TOLD = ("quantisation", "voltage_told")
SOFT = 0.01  # [rad] residuals beyond it count linearly, not by their square
ROUNDS = 15
DAMPING = 10.0 ** np.arange(-3, 3.1)


@dataclass(frozen=True)
class Nominal:
    """A law fitted to runs.

    Attributes:
        values: every number of the law.
        error: mean absolute error on the runs it was fitted to [rad].
        at_bound: free numbers that ended on a bound.
    """

    values: Mapping[str, float]
    error: float
    at_bound: tuple[str, ...] = ()

    def told(self, runs: Runs) -> Law:
        """The law of each run, with what is told of it, arrays ``(R, 1)``."""
        numbers = {name: np.float64(value) for name, value in self.values.items()}
        known = {k: v[:, None] for k, v in runs.told.items() if k not in NOT_TOLD}
        return law({**numbers, **known})

    def predict(self, runs: Runs) -> np.ndarray:
        """Angles that the nominal law gives, shape ``(R, T)`` [rad]."""
        return simulate(self.told(runs), runs.drive)[:, 0]


def usual(runs: Runs) -> Nominal:
    """The law of the servo that runs are of, as their condition `servo` says; without
    it that of the STS3215.

    Raises:
        UnknownNameError: a servo whose law is not known.
        BnsError: runs of several servos.
    """
    name, *others = sorted(set(runs.labels.get(SERVO, (USUAL,))))
    if others:
        raise BnsError(
            f"The runs are of several servos ({name}, {', '.join(others)}); diagnose "
            "one at a time."
        )
    if name not in SERVOS:
        raise UnknownNameError("servo", name, SERVOS)
    return Nominal(SERVOS[name](), 0.0)


def fit(
    runs: Runs,
    *,
    free: Sequence[str] = FREE,
    start: Mapping[str, float] | None = None,
) -> Nominal:
    """The law that explains the runs best, in mean absolute error.

    Damped Gauss-Newton from several starts, all derivatives of a round in one batch;
    each start begins with the numbers that matter most, so that the richer fit can
    never end worse than the simpler one it contains.

    Args:
        runs: with their settings told; several gains, levers or masses, and some that
            fall unpowered, or friction and inertia trade off.
        free: numbers to adjust.
        start: values to start from in place of those of `usual`.

    Raises:
        UnknownNameError: a number that the law does not have.
        BnsError: too few samples for the free numbers.
    """
    for name in free:
        if name not in NUMBERS:
            raise UnknownNameError("number of the servo law", name, NUMBERS)
    if runs.angles.size < 50 * len(free):
        raise BnsError(
            f"{runs.angles.size} samples do not fix {len(free)} numbers of the law; "
            "give more runs or fewer free numbers."
        )
    base = {**usual(runs).values, **(start or {})}
    found = [_descend(runs, free, base)]
    weak = {"load_friction": 0.15, "coulomb": 0.15, "stribeck": 0.1, "delay": 0.015}
    other = {**base, **{k: v for k, v in weak.items() if k in free}}
    found.append(_descend(runs, free, other))
    values, error = min(found, key=lambda item: item[1])
    edge = [
        name
        for name in free
        if values[name] <= NUMBERS[name].low or values[name] >= NUMBERS[name].high
    ]
    return Nominal(values, error, tuple(edge))


def _descend(
    runs: Runs, free: Sequence[str], base: Mapping[str, float]
) -> tuple[dict[str, float], float]:
    low = np.array([NUMBERS[name].low for name in free])
    high = np.array([NUMBERS[name].high for name in free])
    point = np.array([base[name] for name in free])
    scale = np.maximum(np.abs(point), 0.01)
    known = Nominal(base, 0.0).told(runs)

    def residuals(points: np.ndarray) -> np.ndarray:
        moved = {name: points[None, :, i] for i, name in enumerate(free)}
        return simulate({**known, **moved}, runs.drive) - runs.angles[:, None]

    error = float(np.abs(residuals(point[None])).mean())
    for _ in range(ROUNDS):
        inward = np.where(point + 1e-3 * scale > high, -1e-3, 1e-3)
        around = residuals(point + np.vstack([0 * point, np.diag(inward * scale)]))
        now = around[:, 0].ravel()
        slopes = (around[:, 1:] - around[:, :1]) / inward[:, None]  # per scale
        slopes = slopes.transpose(0, 2, 1).reshape(-1, len(point))
        weighted = slopes / np.maximum(np.abs(now), SOFT)[:, None]
        normal, pull = weighted.T @ slopes, weighted.T @ now
        ridge = np.diag(np.diag(normal) + 1e-9)
        moves = [np.linalg.solve(normal + d * ridge, pull) for d in DAMPING]
        tries = np.clip(point - np.array(moves) * scale, low, high)
        errors = np.abs(residuals(tries)).mean(axis=(0, 2))
        best = int(np.argmin(errors))
        if not errors[best] < error * (1 - 1e-4):
            break
        point, error = tries[best], float(errors[best])
    return {**base, **dict(zip(free, map(float, point), strict=True))}, error
