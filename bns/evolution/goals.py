"""Chromosomes of walking robots: K commands of servo goals, always all of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from bns.draws import Draws, whole_below
from bns.errors import BnsError
from bns.evolution.chromosome import Population
from bns.evolution.generation import Breeder, Coins, Rates
from bns.evolution.selection import tournament_by_rank
from bns.experiment import robots
from bns.experiment.config import RunConfig
from bns.experiment.task_settings import WalkConfig
from bns.worlds.trial import Channel, Commands

TICK = math.radians(300 / 1023)  # [rad] AX-12A manual: 300 degrees are 1023 ticks


@dataclass(frozen=True)
class Goals:
    """What genes may be, and what they mean: goals of C servos from half-way [rad].

    Attributes:
        low, high: bounds of the goals, each ``(C,)`` [rad].
        initial: random goals lie within this of half-way, and within bounds [rad].
        max_commands: K.
        limit: longest time of a command [s].
        channels: the servos.
        ranges: their end stops, ``(C, 2)`` [rad].
    """

    low: Tensor
    high: Tensor
    initial: float
    max_commands: int
    limit: float
    channels: tuple[Channel, ...]
    ranges: np.ndarray

    @classmethod
    def of(cls, config: RunConfig) -> "Goals":
        """The encoding that a configuration asks for.

        Raises:
            UnknownNameError: no such robot.
            BnsError: a robot without legs.
        """
        robot, walk = robots.told(config.world.robot), config.walk
        if robot.kind != "legged":
            raise BnsError(
                f"Robot {config.world.robot!r} is {robot.kind} and cannot walk: take "
                "world.robot = 'phantomx', or another task."
            )
        bounds = torch.tensor(robot.ranges, dtype=torch.float32, device=config.device)
        farthest = torch.from_numpy(reaches(walk, robot.channels)).to(bounds)
        return cls(
            low=bounds[:, 0].maximum(-farthest),
            high=bounds[:, 1].minimum(farthest),
            initial=walk.initial,
            max_commands=walk.commands,
            limit=walk.limit,
            channels=robot.channels,
            ranges=robot.ranges,
        )

    @property
    def gene_shape(self) -> tuple[int, int]:
        """Genes of an individual: commands times servos."""
        return self.max_commands, len(self.channels)

    def random(self, runs: int, population: int, draws: Draws) -> Population:
        """Goals uniform around half-way.

        Args:
            runs: R.
            population: P, individuals of each run.
            draws: source of randomness.
        """
        coins = draws.uniform(runs, population, *self.gene_shape)
        return self.individuals(coins, coins[..., 0, 0])

    def individuals(self, coins: Tensor, coins_lengths: Tensor) -> Population:
        """Random individuals from uniform numbers ``(R, P, K, C)``.

        The second argument only says how many; all have K commands.
        """
        low = self.low.clamp(min=-self.initial)
        high = self.high.clamp(max=self.initial)
        lengths = torch.full_like(coins_lengths, self.max_commands, dtype=torch.long)
        return Population(low + coins * (high - low), lengths)

    def commands(self, individual: Population) -> list[Commands]:
        """The first individual of each run as commands for a world."""
        low, high = self.ranges.T  # the exact ones: float32 may lie a hair beyond
        goals = individual.genes[:, 0].cpu().double().numpy()
        longest = np.full(self.max_commands, self.limit)
        return [Commands(row.clip(low, high), longest, self.channels) for row in goals]


def reaches(
    walk: WalkConfig, channels: Sequence[Channel], grown: float = 1.0
) -> np.ndarray:
    """How far goals of servos may be from half-way, ``(C,)`` [rad].

    Args:
        walk: settings.
        channels: the servos.
        grown: how much of the way from `reach` to `coxa_reach` coxae have come.
    """
    wider = max(walk.coxa_reach - walk.reach, 0.0) * grown
    coxae = [channel.name.endswith("_coxa") for channel in channels]
    found: np.ndarray = walk.reach + wider * np.array(coxae)
    return found


class GoalBreeder(Breeder):
    """Makes the next population; children of crossover stay within the bounds, too.

    The winner of a tournament is drawn by its rank, as likely as if all entrants had
    been drawn: the dissertation's are of 200, and such numbers are dear.
    """

    def draw(self, draws: Draws, rates: Rates) -> Coins:
        """The random numbers of one generation, one a parent."""
        one = replace(self.config, tournament=1)
        coins = Breeder(one, self.encoding, self.fixed_length).draw(draws, rates)
        if rates.repeat is None:
            return coins
        shape = (*coins.chicken.shape, COINS)
        return coins._replace(repeat=draws.uniform(*shape))

    def parents(self, cost: Tensor, coins: Tensor) -> Tensor:
        """Indices of the parents, see `Breeder.parents`."""
        if self.config.selection != "tournament":
            return super().parents(cost, coins)
        return tournament_by_rank(cost, coins[..., 0], self.config.tournament)

    def breed(
        self, population: Population, cost: Tensor, rates: Rates, coins: Coins
    ) -> Population:
        """See `Breeder.breed`; goals are kept within their bounds."""
        bred = super().breed(population, cost, rates, coins)
        low, high = self.encoding.low, self.encoding.high
        if rates.reach is not None:
            low, high = low.maximum(-rates.reach), high.minimum(rates.reach)
        return bred._replace(genes=torch.minimum(torch.maximum(bred.genes, low), high))

    def _mutate(self, children: Population, rates: Rates, coins: Coins) -> Population:
        mutated = super()._mutate(children, rates, coins)
        if rates.repeat is None or coins.repeat is None:
            return mutated
        genes = repeated(mutated.genes, coins.repeat, rates.repeat)
        return mutated._replace(genes=genes)


PERIODS = (2, 3, 4)  # commands of a round
COINS = 6  # uniform numbers that a child takes


def repeated(genes: Tensor, coins: Tensor, chance: Tensor) -> Tensor:
    """Children of which some repeat their own commands.

    With `chance` one command is copied to another place, and with `chance` the
    commands go round from some place on, in one of `PERIODS`.

    Args:
        genes: ``(R, N, K, C)``.
        coins: uniform numbers, ``(R, N, COINS)``.
        chance: of each run, ``(R,)``.
    """
    chance = chance[:, None, None]
    count = genes.shape[2]
    copies, source, target, rounds, begin, period = coins.unsqueeze(-1).unbind(-2)
    place = torch.arange(count, device=genes.device).expand(*genes.shape[:2], -1)
    hit = (copies < chance) & (place == whole_below(target, count))
    copied = torch.where(hit, whole_below(source, count), place)
    first = whole_below(begin, max(count - PERIODS[-1], 1))
    length = PERIODS[0] + whole_below(period, len(PERIODS))
    after = (rounds < chance) & (place >= first)
    turned = torch.where(after, first + (place - first) % length, place)
    index = copied.gather(2, turned)
    return genes.gather(2, index.unsqueeze(-1).expand_as(genes))
