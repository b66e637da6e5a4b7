"""What happened to a walking robot in a trial, beside where it went."""

from collections.abc import Mapping

import numpy as np

from bns.models.ax12a import HOTTEST
from bns.worlds.physics import observe
from bns.worlds.trial import Outcome

Laws = Mapping[str, np.ndarray]

SATURATED = 0.98  # share of the torque limit that counts as all of it; assumed
OVERLOAD_TIME = 1.0  # [s] at the limit until the servo gives up; assumed
STALLED = 0.1  # [rad/s] slower = it pushes in vain; assumed
HEAT_CAPACITY = 50.0  # [J/K] 54.6 g of copper, steel and plastic; assumed
LYING = 0.002  # [m] height of the belly or a hip at which the robot lies; assumed
AMBIENT = 40.0  # [deg C] of the servos at the start of a trial; assumed


def outcome(
    free: np.ndarray,
    angles: np.ndarray,
    speeds: np.ndarray,
    goals: np.ndarray,
    laws: dict[str, np.ndarray],
    carried: np.ndarray,
    *,
    dt: float,
    arena: tuple[float, float],
    touched: bool,
    rested: bool,
    diverged: bool,
) -> Outcome:
    """The flags of a trial.

    Args:
        free: the base's free joint on the physics grid, shape ``(S + 1, 7)``.
        angles, speeds: of the servos, shape ``(L, C)`` [rad, rad/s].
        goals: in force then, shape ``(L, C)`` [rad].
        laws: numbers of the servos, each of shape ``(C,)``.
        carried: what may not touch the floor, see `lies`.
        dt: between two of these L moments [s].
        arena: size of the board along x and y [m], centred on the origin.
        touched: whether the robot's own parts touched.
        rested: whether every command ended at rest.
        diverged: whether the physics did.
    """
    duty = _duty(goals, angles, laws)
    pushing = (np.abs(duty) > SATURATED * laws["duty_limit"]) & (
        np.abs(speeds) < STALLED
    )
    seen = observe.outcome(free, arena, diverged)
    return seen._replace(
        fell=seen.fell or lies(free, carried),
        collided=touched,
        unrested=not rested,
        overloaded=_for_long(pushing & (laws["powered"] > 0), OVERLOAD_TIME / dt),
        overheated=bool((_heated(duty, speeds, laws, dt) > HOTTEST).any()),
    )


def lies(free: np.ndarray, carried: np.ndarray) -> bool:
    """Whether the body or a hip is on the floor at some time.

    Args:
        free: the base's free joint, shape ``(S, 7)``.
        carried: balls around points of the base that legs should carry: x, y, z and
            radius, shape ``(P, 4)`` [m].
    """
    w, i, j, k = free[:, 3:].T
    up = 2 * np.array([i * k - w * j, j * k + w * i, 0.5 - i * i - j * j])
    heights = carried[:, :3] @ up + free[:, 2] - carried[:, 3:]
    return bool((heights < LYING).any())


def _duty(goals: np.ndarray, angles: np.ndarray, laws: Laws) -> np.ndarray:
    """Share of the supply on each motor, shape ``(S, C)``."""
    wanted = laws["gain"] * laws["error_gain"] * (goals - angles)
    return np.clip(wanted, -laws["duty_limit"], laws["duty_limit"]) * laws["powered"]


def _heated(duty: np.ndarray, speeds: np.ndarray, laws: Laws, dt: float) -> np.ndarray:
    """Servos' temperatures at the end if none is given off, shape ``(C,)`` [deg C]."""
    driving = duty * laws["voltage"] - laws["torque_constant"] * speeds * (duty != 0)
    heat = np.nansum(driving**2, axis=0) / laws["resistance"] * dt  # [J]
    return AMBIENT + heat / HEAT_CAPACITY


def _for_long(on: np.ndarray, steps: float) -> bool:
    """Whether a column is true for so many steps on end."""
    count = max(round(steps), 1)
    if len(on) < count:
        return False
    total = np.vstack([np.zeros((1, on.shape[1]), int), np.cumsum(on, axis=0)])
    return bool((total[count:] - total[:-count] == count).any())
