"""NEAT (Stanley and Miikkulainen 2002): networks of any topology, inside the SNNs.

In the place of BNS's population of fixed networks, in light following. All else is as
in BNS: the SNNs, how they are trained and forget, what is tried, what is deployed. With
a prior (`prior.world light`) networks evolve in that model first, one execution each,
until its evaluations are spent, and its best is tried first.

What a network is worth changes with every trial, so species remember how well they did
from one generation to the next, but not from one trial to the next.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, cast

import numpy as np
import torch
from torch import Tensor

from bns import seeding
from bns.draws import Draws
from bns.errors import BnsError
from bns.evolution import neat
from bns.evolution.chromosome import Population
from bns.evolution.generation import Rates
from bns.evolution.neat import Lineage, NeatSettings
from bns.evolution.topology import KINDS, SLOPE, Ends, Marks, networks, sizes
from bns.experiment.config import RunConfig
from bns.learners.base import Curves, Panel, Proposal
from bns.learners.bns.config import BNS_SECTIONS
from bns.learners.bns.learner import SNN_ERROR, Bns
from bns.learners.bns.light.problem import LightProblem
from bns.learners.bns.memory import Memory
from bns.learners.bns.problem import Problem
from bns.tasks.base import Task
from bns.tasks.light_controller import OUTPUTS, Controllers, LightController
from bns.worlds.world import CountedWorld


@dataclass(frozen=True)
class NeatControllers(Controllers):
    """Networks of any topology from readings to wheel speeds.

    A genome is `most` genes of `bns.evolution.topology`, one after another. Each node
    has a sigmoid from 0 to 1; of an output 0 is the lowest speed, 1 the highest.

    Attributes:
        most: connections at most.
    """

    most: int = 60

    @property
    def ends(self) -> Ends:
        """Inputs and outputs."""
        return Ends(self.inputs, OUTPUTS)

    @property
    def genes(self) -> int:
        """Numbers of a genome."""
        return self.most * KINDS

    def layers(self, genomes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The weights of genomes.

        Args:
            genomes: ``(R, P, genes)``.

        Returns:
            From outputs and hidden nodes to them ``(R, P, M, M)``, from inputs and bias
            to them ``(R, P, M, I + 1)``, and how often to apply the former, ``()``.

        Raises:
            BnsError: genomes of another length.
        """
        runs, count, length = genomes.shape
        if length != self.genes:
            raise BnsError(
                f"A genome has {length} numbers; a network of at most {self.most} "
                f"connections has {self.genes}."
            )
        rows = genomes.reshape(-1, self.most, KINDS).cpu().numpy()
        inner, outer, passes = networks(rows, self.ends)
        made = [
            torch.from_numpy(part.reshape(runs, count, *part.shape[1:]).copy())
            for part in (inner, outer)
        ]
        inside, outside = (part.to(genomes.device) for part in made)
        return inside, outside, torch.tensor(passes)

    def act(self, layers: tuple[Tensor, ...], inputs: list[Tensor]) -> list[Tensor]:
        """See `Controllers.act`."""
        inner, outer, passes = layers
        seen = torch.stack([*inputs, torch.ones_like(inputs[0])], dim=-1)
        driven = outer @ seen.permute(0, 2, 3, 1)  # (R, P, M, S)
        active = (SLOPE * driven).sigmoid()
        for _ in range(int(passes)):
            active = (SLOPE * (inner @ active + driven)).sigmoid()
        return [2 * active[:, :, side].transpose(1, 2) - 1 for side in range(OUTPUTS)]


@dataclass(frozen=True)
class Genomes:
    """Genomes of networks, as rows of numbers.

    Attributes:
        controllers: what they have in common.
        power: random weights lie between - and + this.
    """

    controllers: NeatControllers
    power: float

    @property
    def max_commands(self) -> int:
        """Numbers of a genome, D."""
        return self.controllers.genes

    @property
    def gene_shape(self) -> tuple[int, int]:
        """Numbers of an individual: places times kinds."""
        return self.max_commands, 1

    def random(self, rows: int, population: int, draws: Draws) -> Population:
        """Networks without hidden nodes, of uniformly random weights.

        Args:
            rows: R I, the islands of all runs.
            population: P, individuals of each row.
            draws: source of randomness.
        """
        kind = self.controllers
        coins = draws.uniform(rows, population, kind.ends.links)
        weights = self.power * (2 * coins.cpu().numpy() - 1)
        genes = kind.ends.first(weights, kind.most).reshape(rows, population, -1, 1)
        lengths = torch.full((rows, population), self.max_commands, dtype=torch.long)
        return Population(
            torch.from_numpy(genes).to(coins.device), lengths.to(coins.device)
        )


class NeatProblem(LightProblem):
    """Light following with networks whose topology evolves; see `LightProblem`."""

    stream = "neat"
    relative_cost = 0.0

    def set_up(self) -> None:
        """See `Problem.set_up`."""
        super().set_up()
        plain = self.simulator.controllers
        self.rule = cast(NeatSettings, self.config.settings)
        common = {name: getattr(plain, name) for name in plain.__dataclass_fields__}
        self.kind = NeatControllers(**common, most=self.rule.most)
        if self.kind.ends.links > self.rule.most:
            raise BnsError(
                f"settings.most = {self.rule.most} is less than the "
                f"{self.kind.ends.links} connections of a first network: give more."
            )
        self.simulator = replace(self.simulator, controllers=self.kind)
        self._advance = self.simulator.advance
        self.genomes = Genomes(self.kind, self.rule.power)
        self.marks = [Marks.of(self.kind.ends) for _ in range(self.runs)]

    def random(self) -> Population:
        """See `Problem.random`."""
        size = self.config.evolution.population // self.islands
        return self.genomes.random(self.runs * self.islands, size, self.draws)

    def evolve(
        self,
        memories: Sequence[Memory],
        population: Population,
        cost: Tensor,
        rates: Rates,
        generations: int,
    ) -> tuple[Population, Tensor]:
        """See `Problem.evolve`; rates are those of NEAT's own settings."""
        del rates
        lineages = [Lineage() for _ in cost]
        rng = self.generator()
        for _ in range(generations):
            population = self.next(population, cost, lineages, rng)
            cost = self.cost(memories, population)
        return population, cost

    def generator(self) -> np.random.Generator:
        """A generator that goes on where the draws of the learner are."""
        words = (self.draws.uniform(8).cpu().numpy() * 2**24).astype(np.uint32)
        return np.random.default_rng(words)

    def next(
        self,
        population: Population,
        cost: Tensor,
        lineages: Sequence[Lineage],
        rng: np.random.Generator,
    ) -> Population:
        """The next generation of every row; worth is 1 / (1 + cost).

        Args:
            population: of all rows.
            cost: ``(R I, P / I)``.
            lineages: of the rows; go on.
            rng: the only source of randomness.
        """
        rows, size = cost.shape
        genes = self.genes(population)
        worth = 1 / (1 + np.nan_to_num(cost.double().cpu().numpy(), nan=np.inf))
        made = []
        for row in range(rows):
            marks = self.marks[row // self.islands]
            told = (lineages[row], marks, self.kind.ends, self.rule, rng)
            made.append(neat.bred(genes[row], worth[row] + 1e-12, *told))
        numbers = torch.from_numpy(np.stack(made).reshape(rows, size, -1, 1))
        return population._replace(genes=numbers.to(population.genes))

    def genes(self, population: Population) -> np.ndarray:
        """Of every row, ``(R I, P / I, C, 5)``."""
        rows, size = population.lengths.shape
        numbers = population.genes.cpu().numpy()
        return numbers.reshape(rows, size, self.kind.most, KINDS)

    def controllers(self, chosen: Population) -> list[Any]:
        """See `Problem.controllers`."""
        light = self.config.light
        return [
            LightController(self.kind, row, light.cycles, light.cycle)
            for row in chosen.genes[:, 0, :, 0].cpu()
        ]

    def diversity(self, population: Population) -> dict[str, np.ndarray]:
        """See `Problem.diversity`: of topologies, `Neat.columns`."""
        genes = self.genes(population)
        counts = np.array([list(sizes(row, self.kind.ends)) for row in genes])
        species = []
        for row in genes:
            lineage = Lineage()
            lineage.sort(row, self.rule)
            species.append(len(lineage.species))
        each = np.reshape(species, (self.runs, -1)).sum(1).astype(np.float64)
        hidden, on = counts.reshape(self.runs, -1, 2).mean(1).T
        return {"species": each, "hidden_nodes": hidden, "connections": on}

    def state(self) -> dict[str, np.ndarray]:
        """See `Problem.state`: the next numbers of inventions, ``(R, 2)``."""
        told = [[marks.innovation, marks.node] for marks in self.marks]
        return {"marks": np.array(told, np.int64)}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Problem.restore`."""
        self.marks = [Marks(*row) for row in arrays["marks"].tolist()]


TOPOLOGY = Curves(
    name="topology",
    title="Networks of the population",
    caption=(
        "How many species there are, and how large the networks are in the mean. {band}"
    ),
    label="of the population",
    panels=(
        Panel("species", "species"),
        Panel("hidden_nodes", "hidden nodes"),
        Panel("connections", "connections"),
    ),
)


class Neat(Bns):
    """R runs of NEAT inside the SNNs; arguments as `Learner`."""

    Settings = NeatSettings
    sections = tuple(
        name for name in BNS_SECTIONS if name not in ("evolution", "compiled")
    )
    columns: ClassVar[Mapping[str, str]] = {
        **{n: text for n, text in Bns.columns.items() if "diversity" not in n},
        "species": "of the population",
        "hidden_nodes": "of the population's networks, mean",
        "connections": "of the population's networks that are on, mean",
    }
    figures = (SNN_ERROR, "displacement", TOPOLOGY)
    kinds = ("light",)

    def __init__(
        self,
        configs: Sequence[RunConfig],
        *,
        replicates: Sequence[int],
        onsets: Sequence[int],
        models: Sequence[CountedWorld] = (),
    ):
        configs = [_inside(config) for config in configs]
        super().__init__(configs, replicates=replicates, onsets=onsets, models=models)
        self.problem: NeatProblem

    @classmethod
    def kind(cls, task: Task) -> type[Problem]:
        """See `Bns.kind`.

        Raises:
            BnsError: not light following.
        """
        if task.problem() is not LightProblem:
            raise BnsError(
                "The learner 'neat' knows no simulator networks but those of light "
                "following: give --task.name light."
            )
        return NeatProblem

    @classmethod
    def figures_of(cls, task: Task) -> list[Curves | str]:
        """See `Learner.figures_of`."""
        return [SNN_ERROR, *cls.kind(task).figures, "displacement", TOPOLOGY]

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Bns.propose`; with a prior, what evolved in that comes first."""
        if trial > 0 or not self.models:
            return super().propose(trial)
        self._evolve_in_models()
        self._trial, self._generations = trial, 0
        return self._proposal(trial, self.cost.reshape(self.runs, -1))

    def _evolve_in_models(self) -> None:
        """Whole generations in each run's model, as long as there are evaluations."""
        rule, problem = cast(NeatSettings, self.config.settings), self.problem
        lineages = [Lineage() for _ in range(self.runs * problem.islands)]
        rng, generation = problem.generator(), 0
        while min(model.left for model in self.models) >= rule.population:
            if generation:
                self.population = problem.next(
                    self.population, self.cost, lineages, rng
                )
            self.cost = self._cost_in_models(generation)
            generation += 1
        if not generation:
            raise BnsError(
                f"prior.evaluations = {self.models[0].limit} is less than the "
                f"{rule.population} networks of a generation: give more, or fewer "
                "networks."
            )

    def _cost_in_models(self, generation: int) -> Tensor:
        """Cost of each network from the same start as the others, ``(R I, P / I)``."""
        found, problem = [], self.problem
        genomes = self._by_run(self.population).genes
        for run, (replicate, model) in enumerate(
            zip(self.replicates, self.models, strict=True)
        ):
            rows = Population(genomes[run].unsqueeze(1), torch.empty(0))
            tried = problem.controllers(rows)
            seed = seeding.integer(self.config.seed, "neat", replicate, generation)
            seeds = [seed] * len(tried)
            trials = self.task.execute(model, tried, trial=0, seeds=seeds)
            found.append(self.task.fitness(trials))
        cost = torch.from_numpy(np.concatenate(found)).float()
        return cost.reshape(self.population.lengths.shape).to(genomes.device)

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`; beside, what models have spent."""
        return super().state() | self.spent()

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        super().restore(arrays)
        self.restore_spent(arrays)


def _inside(config: RunConfig) -> RunConfig:
    """A configuration whose evolution has as many individuals as NEAT has networks."""
    rule: Any = config.settings
    if (
        config.adaptation.mutation_rate_after
        or config.adaptation.mutation_magnitude_after
    ):
        raise BnsError(
            "adaptation.mutation_rate_after and mutation_magnitude_after do nothing to "
            "NEAT, which has rates of its own: leave them out."
        )
    evolution = replace(
        config.evolution,
        population=rule.population,
        generations=rule.generations,
        tournament=min(config.evolution.tournament, rule.population),
    )
    return replace(config, evolution=evolution, compiled="no")


LEARNER = Neat
