"""PETS with iCEM (Chua et al. 2018; Pinneri et al. 2020): plans inside an ensemble.

After each trial an ensemble of networks is trained on all that the window holds; before
each, the improved cross-entropy method looks for the controller that costs least on
average over the networks, each of which drives a path of its own (trajectory sampling,
each particle with one network throughout). In the original the networks foresee a
variance, too, are trained on bootstrapped patterns, and plans are made anew after every
action: here they are the SNNs of BNS, which differ by their first weights, and
controllers are driven blindly to their end.

All but the search is BNS on the same task: the networks and their training, windows,
resets, what is tried, and what is deployed. In walking the worth of paths inside the
ensemble is that of BNS (`walk.fitness`), which has each network's own path in it.

The improved cross-entropy method (iCEM), batched over runs: a normal distribution over
genes is sampled, and fitted to the elites, the best of the sample. As in the original:
each sample is smaller than the one before, by a factor, but never smaller than two for
each elite; a share of the elites stays in the next sample, and in the first one of the
next search; the last sample has the mean itself in it; mean and spread move by a share
of the way. Best of all is the best ever sampled.

What differs in it: the original plans again after every action, shifts its plan by
one, and draws noise that is correlated in time. Here a plan is a whole list of commands
that is driven blindly: there is nothing to shift, and noise is white. Lists vary in
length: so does a normal number that is rounded, and a command's distribution is fitted
to those elites that have it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import ClassVar, NamedTuple, cast

import torch
from torch import Tensor

from bns.draws import Draws
from bns.evolution.chromosome import Population
from bns.evolution.generation import Genes, take
from bns.evolution.variation import normal
from bns.experiment.config import LearnerSettings, RunConfig
from bns.learners.bns.config import BNS_SECTIONS
from bns.learners.bns.learner import Bns
from bns.learners.bns.navigation import Evaluator, OpenLoopProblem
from bns.snn.network import forward
from bns.worlds.world import CountedWorld


class Normal(NamedTuple):
    """Where the next sample is drawn, independent numbers.

    Attributes:
        mean, spread: of genes as shares of their range, ``(R, K, C)``.
        length, length_spread: of the lists' lengths, ``(R,)``.
    """

    mean: Tensor
    spread: Tensor
    length: Tensor
    length_spread: Tensor

    def towards(self, other: "Normal", momentum: float) -> "Normal":
        """The whole way to another one but for the share `momentum`."""
        both = zip(self, other, strict=True)
        return Normal(*(momentum * a + (1 - momentum) * b for a, b in both))


@dataclass(frozen=True, kw_only=True)
class Icem:
    """The method's numbers.

    Attributes:
        population: individuals of the first sample.
        iterations: samples of a search.
        decay: by which factor each sample is smaller than the one before.
        elites: individuals that the distribution is fitted to.
        kept: share of the elites that stay in the next sample; at least one does.
        momentum: share of the old mean and spread.
        spread: standard deviation at first, as a share of a gene's range.
        fixed_length: whether all lists are as long as can be.
    """

    population: int
    iterations: int
    decay: float
    elites: int
    kept: float
    momentum: float
    spread: float
    fixed_length: bool

    @property
    def sizes(self) -> list[int]:
        """Individuals of each sample, those that stay and the mean not counted."""
        least = 2 * self.elites
        places = range(self.iterations)
        return [max(round(self.population / self.decay**i), least) for i in places]

    def search(
        self,
        start: Population,
        cost: Callable[[Population], Tensor],
        genes: Genes,
        draws: Draws,
    ) -> tuple[Population, Tensor]:
        """The elites that a search ends with, the best first.

        Args:
            start: where it begins: elites of the search before, or random individuals,
                ``(R, P, ...)``.
            cost: of individuals ``(R, N, ...)``, ``(R, N)``; lower is better.
            genes: what genes may be.
            draws: source of randomness.

        Returns:
            individuals ``(R, elites, ...)``, and their costs ``(R, elites)``.
        """
        kept = max(1, round(self.kept * self.elites))
        elites, costs = best(start, cost(start), kept)
        at = self._first(start, genes)
        for number, size in enumerate(self.sizes):
            drawn = sampled(at, size, genes, draws)
            if number == self.iterations - 1:
                drawn = joined(drawn, _mean(at, genes))
            one, all_costs = best(elites, costs, kept)
            everyone = joined(one, drawn)
            all_costs = torch.cat([all_costs, cost(drawn)], dim=1)
            elites, costs = best(everyone, all_costs, self.elites)
            at = at.towards(fitted(elites, genes, at), self.momentum)
        return elites, costs

    def _first(self, start: Population, genes: Genes) -> Normal:
        runs, longest = len(start.lengths), genes.gene_shape[0]
        middle = torch.full_like(start.genes[:, 0], 0.5)
        wide = torch.full_like(middle, self.spread)
        length = torch.full((runs,), float(longest), device=middle.device)
        at = Normal(middle, wide, length, torch.zeros_like(length))
        around = fitted(start, genes, at)
        if self.fixed_length:
            return at._replace(mean=around.mean)
        some = torch.full_like(length, self.spread * longest)
        return at._replace(mean=around.mean, length=around.length, length_spread=some)


def fitted(elites: Population, genes: Genes, old: Normal) -> Normal:
    """Means and standard deviations of individuals.

    Args:
        elites: ``(R, P, ...)``.
        genes: what genes may be.
        old: holds on at commands that none of them has.
    """
    shares = (elites.genes - genes.low) / (genes.high - genes.low)
    valid = elites.valid.unsqueeze(-1)
    count = valid.sum(1)
    mean = torch.where(valid, shares, 0.0).sum(1) / count.clamp(min=1)
    apart = torch.where(valid, shares - mean.unsqueeze(1), 0.0)
    spread = (apart.square().sum(1) / count.clamp(min=1)).sqrt()
    lengths = elites.lengths.to(mean.dtype)
    return Normal(
        torch.where(count > 0, mean, old.mean),
        torch.where(count > 0, spread, old.spread),
        lengths.mean(1),
        lengths.std(1, unbiased=False),
    )


def sampled(at: Normal, size: int, genes: Genes, draws: Draws) -> Population:
    """Individuals of a distribution, genes and lengths kept within their bounds.

    Args:
        at: the distribution, of R runs.
        size: individuals of each.
        genes: what genes may be.
        draws: source of randomness.
    """
    runs, longest = len(at.length), genes.gene_shape[0]
    noise = normal(draws.uniform(runs, size, *genes.gene_shape))
    shares = (at.mean.unsqueeze(1) + at.spread.unsqueeze(1) * noise).clamp(0, 1)
    noise = normal(draws.uniform(runs, size))
    lengths = at.length[:, None] + at.length_spread[:, None] * noise
    whole = lengths.round().long().clamp(1, longest)
    return _individuals(shares, whole, genes)


def _mean(at: Normal, genes: Genes) -> Population:
    """The mean itself as an individual of each run."""
    lengths = at.length.round().long().clamp(1, genes.gene_shape[0])
    return _individuals(at.mean.unsqueeze(1), lengths[:, None], genes)


def _individuals(shares: Tensor, lengths: Tensor, genes: Genes) -> Population:
    drawn = Population(genes.low + shares * (genes.high - genes.low), lengths)
    return drawn._replace(genes=drawn.genes * drawn.valid.unsqueeze(-1))


def joined(one: Population, other: Population) -> Population:
    """Individuals of both, ``(R, N + M, ...)``."""
    both = zip(one, other, strict=True)
    return Population(*(torch.cat(pair, dim=1) for pair in both))


def best(population: Population, cost: Tensor, count: int) -> tuple[Population, Tensor]:
    """The best individuals and their costs, the best first.

    Args:
        population: ``(R, N, ...)``.
        cost: ``(R, N)``.
        count: how many, at most N.
    """
    index = cost.argsort(dim=1, stable=True)[:, :count]
    return take(population, index), cost.gather(1, index)


@dataclass(frozen=True, kw_only=True)
class PetsSettings(LearnerSettings):
    """Settings of iCEM; the search before a trial takes about 6,000 evaluations inside
    the ensemble, as evolution in BNS does."""

    population: int = 250
    """controllers of the first sample"""
    iterations: int = 60
    """samples before each trial"""
    decay: float = 1.05
    """factor by which each sample is smaller than the one before"""
    elites: int = 30
    """controllers that the distribution is fitted to; no sample has fewer than two for
    each of them"""
    kept: float = 0.3
    """share of the elites that stay in the next sample, and for the next trial"""
    momentum: float = 0.1
    """share of its old mean and spread that the distribution keeps"""
    spread: float = 0.25
    """standard deviation at first, as a share of a gene's range"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "population": (2, 100_000, "controllers"),
        "iterations": (1, 100_000, "samples"),
        "decay": (1, 10, "1"),
        "elites": (2, 10_000, "controllers"),
        "kept": (0, 1, "1"),
        "momentum": (0, 0.99, "1"),
        "spread": (1e-3, 10, "1"),
    }


class Pets(Bns):
    """R runs of PETS as one tensor program; arguments as `Learner`.

    Its networks are an ensemble without dropout, as the original's, whatever `snn.kind`
    and `snn.dropout` say.
    """

    Settings = PetsSettings
    sections = tuple(name for name in BNS_SECTIONS if name != "evolution")
    open_loop = True

    def __init__(
        self,
        configs: Sequence[RunConfig],
        *,
        replicates: Sequence[int],
        onsets: Sequence[int],
        models: Sequence[CountedWorld] = (),
    ):
        inside = [_inside(config) for config in configs]
        super().__init__(inside, replicates=replicates, onsets=onsets, models=models)
        rule = cast(PetsSettings, self.config.settings)
        problem = cast(OpenLoopProblem, self.problem)
        if isinstance(problem.evaluator, Evaluator):
            problem.evaluator = Particles(**vars(problem.evaluator))
        fixed = problem.breeder.fixed_length
        self.search = Icem(**asdict(rule), fixed_length=fixed)

    def _evolve(self, trial: int, generations: int) -> None:
        """A search from the elites of the one before; `generations` are its own."""
        self.population, self.cost = self.search.search(
            self.population,
            lambda individuals: self.problem.cost(self.memories, individuals),
            self.problem.encoding,
            self.draws,
        )

    def run_in_background(self) -> None:
        """See `Learner.run_in_background`; a search is one piece, between trials."""

    def think(self) -> bool:
        """See `Learner.think`."""
        return False


def _inside(config: RunConfig) -> RunConfig:
    """The configuration that BNS is given: its networks, and elites as population."""
    rule = cast(PetsSettings, config.settings)
    evolution = replace(config.evolution, population=rule.elites, tournament=1)
    ensemble = replace(config.snn, kind="ensemble", dropout=0.0)
    return replace(config, evolution=evolution, snn=ensemble)


class Particles(Evaluator):
    """Lists of wheel commands by the mean cost of each network's own path."""

    def judge(
        self, theta: Tensor, inputs: Tensor, lengths: Tensor, *, fused: bool = False
    ) -> Tensor:
        """See `PathEvaluator.judge`."""
        outputs = forward(self.shape, theta, inputs, fused=fused)
        runs, members = outputs.shape[:2]
        each = lengths.repeat_interleave(members, dim=0)
        path = self.composed(outputs.flatten(0, 1), each)
        x, y, yaw = (part.movedim(1, 0) for part in path)
        cost = self.goal.judge(x, y, yaw, each)
        return cost.view(runs, members, -1).mean(1)


LEARNER = Pets
