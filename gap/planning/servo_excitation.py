"""Commands that are safe for a servo that swings a mass on a lever.

Goals stay within `REACH` of hanging; steps are as large as recordings of such servos
have them, the rest is slower than `SWIFT`. Each is offered at the gain that was told
and at a quarter of it: soft control shows the load that stiff control hides.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from bns import seeding
from bns.gap.planning.excitation import Excitation
from bns.worlds.trial import Channel, Commands

REACH = 1.2  # [rad] from hanging; assumed
SWIFT = 4.0  # [rad/s] fastest goal; assumed, below a small servo's 4.7
LENGTH, HELD = 6.0, 0.02  # [s] of each; of one goal
SOFT = 0.25  # times the told gain
CHANNELS = (Channel("goal", "rad"), Channel("torque_on", "1"))


def servo(*, seed: int = 0, told: Mapping[str, float] | None = None) -> tuple:
    """The family.

    Args:
        seed: of the random ones.
        told: conditions of the recordings so far; gain [firmware units] counts.
    """
    known = dict(told or {})
    made = [Excitation(n, c, known) for n, c in _commands(seed)]
    if "gain" in known:
        soft = {**known, "gain": SOFT * known["gain"]}
        made += [
            Excitation(f"{item.name}, at gain {soft['gain']:g}", item.commands, soft)
            for item in made
        ]
    return tuple(made)


def _commands(seed: int) -> Iterator[tuple[str, Commands]]:
    t = np.arange(round(LENGTH / HELD)) * HELD
    phase = t / LENGTH
    yield "slow sweep, there and back", _goals(REACH * np.sin(2 * np.pi * phase))
    for size in (0.1, 0.3):
        wave = np.sin(2 * np.pi * (0.3 * t + 0.15 * t**2))
        yield f"ever faster sweep of {size:g} rad", _goals(size * wave)
    for size in (0.03, 0.1, 0.3, 0.8):
        for held in (0.3, 1.0):
            steps = size * np.sign(np.sin(np.pi * t / held + 1e-9))
            yield f"steps of {size:g} rad, each for {held:g} s", _goals(steps)
    for size in (0.05, 0.2):
        teeth = size * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * t))
        yield f"reversals of {size:g} rad about hanging", _goals(teeth)
    stairs = np.minimum(np.floor(phase * 6), 5) / 5 * REACH
    yield "stairs up, held on each", _goals(stairs)
    lift = REACH * np.clip(t / 2.0, 0.0, 1.0)
    on = (t < 3.0).astype(float)
    yield "lift, then let fall with the motor off", _goals(lift, on)
    rng = seeding.generator(seed, "gap", "servo excite")
    for number in range(3):
        yield f"random drive {number + 1}", _goals(_random(rng, t))


def _random(rng: np.random.Generator, t: np.ndarray) -> np.ndarray:
    """Goals between random ones, no faster than `SWIFT`."""
    marks = np.linspace(0.0, LENGTH, 9)
    goals = np.interp(t, marks, rng.uniform(-REACH, REACH, len(marks)))
    return np.clip(goals, -REACH, REACH)


def _goals(goals: np.ndarray, on: np.ndarray | None = None) -> Commands:
    on = np.ones(len(goals)) if on is None else on
    held = np.full(len(goals), HELD)
    return Commands(np.stack([goals, on], axis=1), held, CHANNELS)
