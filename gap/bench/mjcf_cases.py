"""Recordings of a user's own robot made in simulation: for tests and blind cases."""

from collections.abc import Sequence

import numpy as np

from bns import seeding
from bns.gap.bench.cases import Stand
from bns.gap.models.mjcf import effects as own_effects
from bns.gap.models.mjcf.model import OwnModel
from bns.gap.planning import excitation
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Channel, Commands, Trial

SAMPLE = 0.02  # [s] between two samples
COUNT = 6  # trials
FELT = {
    "command_gain": ("factor", 0.7),
    "command_delay": ("delay", 0.1),
    "command_lag": ("time_constant", 0.1),
    "reading_gain": ("factor", 0.8),
    "reading_delay": ("delay", 0.1),
}
"""effects that are clearly felt"""


class OwnStand(Stand):
    """A user's own robot that cases are made of, see `Stand`.

    Args:
        model: nominal model.
    """

    kinds = ("single", "pair", "none", "fault", "off-library")

    def __init__(self, model: OwnModel):
        super().__init__(model)
        self.own = model

    def commands(self, rng: np.random.Generator) -> list[Commands]:
        """See `Stand.commands`."""
        return commands(self.own, rng)

    def imperfection(self, rng: np.random.Generator) -> list[Effect]:
        """See `Stand.imperfection`: as far off as the description's slack says."""
        return [
            row.make(row.nominal + row.slack * rng.standard_normal())
            for row in self.own.listed
            if row.slack > 0
        ]

    def record(
        self, told: Sequence[Commands], effects: Sequence[Effect], seed: int
    ) -> tuple[Trial, ...]:
        """See `Stand.record`."""
        return tuple(record(self.own, told, effects, seed=seed))

    def unlisted(self, rng: np.random.Generator) -> Effect:
        """See `Stand.unlisted`: on signals, and not in the description."""
        listed = {row.effect for row in self.own.listed}
        names = [name for name in FELT if name not in listed] or list(FELT)
        name = names[int(rng.integers(len(names)))]
        parameter, value = FELT[name]
        return own_effects.make(name, {parameter: value})


def commands(
    model: OwnModel,
    rng: np.random.Generator,
    count: int = COUNT,
    *,
    seconds: float = excitation.LENGTH,
) -> list[Commands]:
    """Random commands inside the limits, each held for 0.3 to 1.5 s.

    Args:
        model: the robot.
        rng: of the commands.
        count: trials.
        seconds: length of each.
    """
    low = np.array([row[0] for row in model.limits.values()])
    high = np.array([row[1] for row in model.limits.values()])
    units = [row[2] for row in model.limits.values()]
    channels = tuple(map(Channel, model.limits, units))
    made = []
    for number in range(count):
        held = rng.uniform(0.3, 1.5, max(2, round(seconds / 1.1)))
        held = np.rint(held * seconds / held.sum() / SAMPLE) * SAMPLE
        share = 1.0 if number % 2 else 0.5
        middle, half = (low + high) / 2, (high - low) / 2
        values = middle + share * half * rng.uniform(-1, 1, (len(held), len(low)))
        made.append(Commands(values, np.maximum(held, SAMPLE), channels))
    return made


def record(
    model: OwnModel,
    told: Sequence[Commands],
    effects: Sequence[Effect],
    *,
    seed: int = 0,
) -> list[Trial]:
    """What the robot would have done with these effects, seen with noise.

    Args:
        model: the robot.
        told: commands of each trial.
        effects: hidden ones.
        seed: of the measurement noise.
    """
    noise = np.array([item.noise for item in model.config.seen])
    blank = [_blank(item, model) for item in told]
    (seen,) = model.simulate(blank, [tuple(effects)])
    made = []
    for number, (trial, values) in enumerate(zip(blank, seen, strict=True)):
        rng = seeding.generator(seed, "gap", "own", number)
        noisy = values + noise * rng.standard_normal(values.shape)
        made.append(trial.replace(observed=noisy))
    return made


def _blank(told: Commands, model: OwnModel) -> Trial:
    ends = np.concatenate([[0.0], np.cumsum(told.durations)])
    grid = np.arange(0.0, ends[-1] + 1e-9, SAMPLE)
    times = np.unique(np.concatenate([grid, ends]).round(6))
    return Trial(
        commands=told,
        times=times,
        observed=np.zeros((len(times), len(model.channels))),
        boundaries=np.searchsorted(times, ends.round(6)),
        channels=tuple(model.channels),
        robot=model.name,
        world="simulated",
    )
