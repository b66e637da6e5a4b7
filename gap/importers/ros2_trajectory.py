"""Commands of a controller of ROS 2 that is told points which lie ahead.

They are those of joint_trajectory_controller. A message replaces what is left of the
trajectory before it. From the command of that moment on the goal goes to each point in
turn, and stays at the last. It goes linearly; by a cubic where points have velocities;
by a quintic where they have accelerations as well. The first message begins at the
angles that were measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

RATE = 100.0  # [Hz] a controller's usual one; states that come faster tell it
LONGEST = 1000  # steps between two states; what is lost for longer is told coarser


@dataclass(frozen=True, eq=False)
class Plan:
    """The points of a message.

    Attributes:
        times: from the message's moment on [s], ``(P,)``, increasing.
        states: positions, velocities and accelerations, ``(P, 3, J)``; NaN = not said.
    """

    times: np.ndarray
    states: np.ndarray


def moments(times: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """When a controller says a goal: with each state, at `RATE` at least.

    Args:
        times: of the states [s], ``(T,)``, increasing.
        starts: of the messages [s], ``(M,)``, increasing.

    Returns:
        from the first message on [s], ``(N,)``, increasing.
    """
    steps = np.clip(np.rint(np.diff(times) * RATE), 1, LONGEST).astype(int)
    places = np.concatenate([[0], np.cumsum(steps)])
    fine = np.interp(np.arange(places[-1] + 1), places, times)
    return np.union1d(fine[fine >= starts[0]], starts)


def goals(
    plans: Sequence[Plan], starts: np.ndarray, first: np.ndarray, when: np.ndarray
) -> np.ndarray:
    """Goals of all joints.

    Args:
        plans: of the messages.
        starts: when these came [s], ``(M,)``, increasing.
        first: positions at the first message, ``(J,)``; NaN = those of its first point.
        when: moments [s], ``(N,)``, increasing, none before the first message.

    Returns:
        positions, ``(N, J)``.
    """
    known = np.where(np.isfinite(first), first, plans[0].states[0, 0])
    state = np.stack([known, np.zeros(len(first)), np.zeros(len(first))])
    edges = [*np.searchsorted(when, starts), len(when)]
    made = np.empty((len(when), len(first)))
    for number, (plan, start) in enumerate(zip(plans, starts, strict=True)):
        way = Plan(
            np.append(0.0, plan.times), np.concatenate([state[None], plan.states])
        )
        rows = slice(edges[number], edges[number + 1])
        made[rows] = _along(way, when[rows] - start)[:, 0]
        until = starts[min(number + 1, len(starts) - 1)] - start
        state = _along(way, np.array([until]))[0]
    return made


def _along(way: Plan, when: np.ndarray) -> np.ndarray:
    """Positions, velocities, accelerations ``(N, 3, J)`` at moments of a way [s]."""
    with np.errstate(over="ignore", invalid="ignore"):  # `checked` says what is too far
        return _at(way, when)


def _at(way: Plan, when: np.ndarray) -> np.ndarray:
    last = len(way.times) - 1
    begin = np.searchsorted(way.times, when, side="right") - 1
    held = begin >= last
    begin = np.minimum(begin, last - 1)
    length = np.maximum(np.diff(way.times)[begin], 1e-12)[:, None]
    power = _powers(way.states[begin], way.states[begin + 1], length)
    share = (when - way.times[begin])[:, None] / length
    made = np.zeros((len(when), 3, way.states.shape[2]))
    for order in range(3):  # of the derivative; the powers are of the share of the way
        for exponent in range(order, 6):
            factor = np.prod(np.arange(exponent - order + 1, exponent + 1))
            part = power[exponent] * share ** (exponent - order) / length**order
            made[:, order] += factor * part
    made[held] = 0.0
    made[held, 0] = way.states[last, 0]
    return made


def _powers(one: np.ndarray, two: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Coefficients ``(6, N, J)`` of polynomials in the share of the way between states.

    Args:
        one, two: at both ends, ``(N, 3, J)``.
        length: of the way in time [s], ``(N, 1)``.
    """
    still = np.zeros_like(one[:, 0])
    far = two[:, 0] - one[:, 0]
    v, w = one[:, 1] * length, two[:, 1] * length
    a, b = one[:, 2] * length**2, two[:, 2] * length**2
    linear = np.stack([one[:, 0], far, still, still, still, still])
    cubic = np.stack([one[:, 0], v, 3 * far - 2 * v - w, v + w - 2 * far, still, still])
    quintic = np.stack(
        [
            one[:, 0],
            v,
            a / 2,
            10 * far - 6 * v - 4 * w - 1.5 * a + b / 2,
            -15 * far + 8 * v + 7 * w + 1.5 * a - b,
            6 * far - 3 * (v + w) - (a - b) / 2,
        ]
    )
    smooth = np.isfinite(v + w)
    return np.where(
        np.isfinite(v + w + a + b), quintic, np.where(smooth, cubic, linear)
    )
