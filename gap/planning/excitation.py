"""Commands that are safe to run and that move a robot in different ways.

A bounded family: steps, ramps, sweeps, reversals, single channels, random stretches,
slow and fast, each about `LENGTH` long and inside the robot's limits. Which of them
separates what is tied is for `plan` to say.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bns import seeding
from bns.worlds.trial import WHEEL_CHANNELS, Channel, Commands

LENGTH = 10.0  # [s] of each
HELD = 0.005  # [s] durations are multiples of it
FAST, SLOW = 0.14, 0.03  # [m/s] wheels; below the robot's 0.17
SHARE = 0.95  # at most, of what a slower robot takes
SWEEP = 0.1  # [s] between the values of a sweep


@dataclass(frozen=True, eq=False)
class Excitation:
    """Commands with a name in words.

    Attributes:
        name: in words.
        commands: what is told.
        conditions: settings of the robot that the command is to be run with.
    """

    name: str
    commands: Commands
    conditions: Mapping[str, float] = field(default_factory=dict)


def fastest(top: float) -> float:
    """Largest wheel speed that a robot is told [m/s], by the largest that it takes."""
    return min(FAST, SHARE * top)


def wheeled(*, seed: int = 0, fastest: float = FAST) -> tuple[Excitation, ...]:
    """Commands for a robot on two wheels.

    Args:
        seed: of the random ones.
        fastest: largest wheel speed [m/s].
    """
    made: list[Excitation] = []
    for word, speed in (("slow", SLOW), ("medium", 0.5 * fastest), ("fast", fastest)):
        v = np.array([speed, speed])
        turn, arc = np.array([-speed, speed]), np.array([0.5 * speed, speed])
        ways = {
            "straight drive, there and back": [v, -v],
            "turn in place, both ways": [turn, -turn],
            "arcs, left and right": [arc, arc[::-1]],
            "arcs backwards, right and left": [-arc, -arc[::-1]],
            "left wheel alone, both ways": [v * [1, 0], -v * [1, 0]],
            "right wheel alone, both ways": [v * [0, 1], -v * [0, 1]],
            "starts and stops": [v, 0 * v, -v, 0 * v, turn, 0 * v, -turn, 0 * v],
        }
        for name, steps in ways.items():
            for held in (5.0, 1.5, 0.4):
                values, times = _cycle(steps, held)
                name_held = f"{word} {name}, each for {held:g} s"
                made.append(_made(name_held, values, times, WHEEL_CHANNELS))
    long = [np.full(2, fastest), np.full(2, -fastest)]
    made.append(_long("long straight drive", long, 8.0))
    made += _wheel_sweeps(fastest)
    rng = seeding.generator(seed, "gap", "excite")
    for number in range(6):
        values, times = _random(rng, 2, fastest if number < 4 else 3 * SLOW)
        made.append(_made(f"random drive {number + 1}", values, times, WHEEL_CHANNELS))
    return tuple(made)


def _wheel_sweeps(fastest: float) -> Iterator[Excitation]:
    count = round(LENGTH / SWEEP)
    phase = np.arange(count) / count
    slow = 2 * SLOW * np.abs(1 - np.abs(4 * phase - 2))
    fast = fastest * np.sin(2 * np.pi * (2 * phase + 14 * phase**2))
    for name, one in (("creep up from rest", slow), ("ever faster reversals", fast)):
        for way, sign in (("straight", 1.0), ("in place", -1.0)):
            values = np.stack([sign * one, one], axis=1)
            times = np.full(count, SWEEP)
            yield _made(f"{name}, {way}", values, times, WHEEL_CHANNELS)


def general(
    limits: Mapping[str, tuple[float, float, str]], *, seed: int = 0
) -> tuple[Excitation, ...]:
    """Commands for a robot of any kind.

    Args:
        limits: lowest and highest value and unit of each command channel.
        seed: of the random ones.
    """
    channels = tuple(Channel(name, unit) for name, (_, _, unit) in limits.items())
    low = np.array([row[0] for row in limits.values()])
    high = np.array([row[1] for row in limits.values()])
    rest = np.clip(0.0, low, high)
    made: list[Excitation] = []
    for word, share in (("small", 0.25), ("half", 0.5), ("full", 0.95)):
        up, down = rest + share * (high - rest), rest + share * (low - rest)
        for at, channel in enumerate(channels):
            for held in (2.5, 1.0, 0.3):
                values, times = _cycle(_alone(rest, up, down, at), held)
                name = f"{word} steps of {channel.name}, each for {held:g} s"
                made.append(_made(name, values, times, channels))
            values, times = _swept(rest, up, down, at)
            name = f"{word} sweep of {channel.name}"
            made.append(_made(name, values, times, channels))
    rng = seeding.generator(seed, "gap", "excite")
    for number in range(6):
        values, times = _random(rng, len(channels), 1.0)
        share = 0.9 * (0.5 if number % 2 else 1.0)
        span = np.where(values > 0, high - rest, rest - low)
        made.append(
            _made(f"random {number + 1}", rest + share * values * span, times, channels)
        )
    return tuple(made)


def _alone(
    rest: np.ndarray, up: np.ndarray, down: np.ndarray, at: int
) -> list[np.ndarray]:
    steps = [rest.copy() for _ in range(4)]
    steps[0][at], steps[2][at] = up[at], down[at]
    return steps


def _swept(
    rest: np.ndarray, up: np.ndarray, down: np.ndarray, at: int
) -> tuple[np.ndarray, np.ndarray]:
    count = round(LENGTH / SWEEP)
    phase = np.arange(count) / count
    wave = np.sin(2 * np.pi * (1.5 * phase + 12 * phase**2))
    values = np.tile(rest, (count, 1))
    span = np.where(wave > 0, up[at] - rest[at], rest[at] - down[at])
    values[:, at] += wave * span
    return values, np.full(count, SWEEP)


def _cycle(steps: Sequence[np.ndarray], held: float) -> tuple[np.ndarray, np.ndarray]:
    count = max(len(steps), round(LENGTH / held))
    values = np.array([steps[k % len(steps)] for k in range(count)])
    return values, np.full(count, held * min(1.0, LENGTH / (count * held)))


def _long(name: str, steps: Sequence[np.ndarray], held: float) -> Excitation:
    return _made(name, np.array(steps), np.full(len(steps), held), WHEEL_CHANNELS)


def _random(
    rng: np.random.Generator, channels: int, largest: float
) -> tuple[np.ndarray, np.ndarray]:
    count = int(rng.integers(8, 14))
    held = rng.uniform(0.3, 1.6, count)
    return rng.uniform(-largest, largest, (count, channels)), held * LENGTH / held.sum()


def _made(
    name: str, values: np.ndarray, times: np.ndarray, channels: tuple[Channel, ...]
) -> Excitation:
    held = np.maximum(np.rint(np.asarray(times) / HELD), 1) * HELD
    return Excitation(name, Commands(np.asarray(values, float), held, channels))
