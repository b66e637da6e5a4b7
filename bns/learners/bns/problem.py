"""What BNS needs to know of a task: genes, networks, and what controllers are worth.

The learner owns the loop (reset, evolve, choose, learn, forget, watch); a problem says
what genes mean, which networks there are, how patterns are made and scaled, and what
the networks foresee of controllers.
"""

import shutil
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from bns.draws import Draws
from bns.errors import BnsError, MissingDependencyError
from bns.evolution import selection
from bns.evolution.chromosome import Population
from bns.evolution.generation import Breeder, Coins, Genes, Rates, take
from bns.experiment.config import RunConfig
from bns.learners.base import Curves
from bns.learners.bns.adaptations import Adaptations
from bns.learners.bns.memory import Memory, Patterns
from bns.snn import training
from bns.snn.network import Shape
from bns.tasks.base import Task
from bns.worlds.trial import Trial

WORTH_COMPILING = 120_000  # generations of all trials; compiling takes some 30 s


def should_compile(config: RunConfig, cost: float) -> bool:
    """Whether a run is compiled.

    Args:
        config: of the run.
        cost: of a generation, that of navigation being 1.

    Raises:
        MissingDependencyError: asked for, but there is no C++ compiler.
    """
    compiler = shutil.which("g++") or shutil.which("clang++") or shutil.which("c++")
    if config.compiled == "yes" and compiler is None:
        raise MissingDependencyError(
            "compiled = 'yes'", "a C++ compiler", "apt-get install g++"
        )
    if config.compiled == "auto":
        work = config.trials * config.evolution.generations * config.replicates
        return compiler is not None and work * cost >= WORTH_COMPILING
    return config.compiled == "yes"


class Problem(ABC):
    """A task as BNS sees it: R runs as one tensor program.

    Args:
        task: what is learned.
        configs: one per run.
        draws: source of randomness, shared with the learner.
        adaptations: schedule and windows of the runs.

    Attributes:
        encoding: what genes may be.
        breeder: makes the next generation.

    Raises:
        BnsError: a setting that BNS cannot be with on this task.
    """

    stream: ClassVar[str]
    """name of the stream of random numbers"""
    channels: ClassVar[tuple[str, ...]] = ()
    """what a change of the robot is looked for in; none = detection is refused"""
    relative_cost: ClassVar[float] = 1.0
    """of a generation, that of navigation being 1; 0 = compiling saves nothing"""
    columns: ClassVar[Mapping[str, str]] = {}
    """figures beside those that the learner has on every task"""
    figures: ClassVar[tuple[Curves, ...]] = ()
    """of these columns"""
    errors: ClassVar[tuple[str, ...]] = ("snn_forward", "snn_left", "snn_turn")
    """names of the networks' errors on a trial before they are trained on it"""
    has_behaviours: ClassVar[bool] = False
    """whether `behaviours` says how controllers do, for a grid of elites"""
    islands = 1
    """populations apart from each other that a run has, rows of their own"""
    encoding: Genes
    breeder: Breeder

    def __init__(
        self,
        task: Task,
        configs: Sequence[RunConfig],
        draws: Draws,
        adaptations: Adaptations,
    ):
        self.task, self.config, self.configs = task, configs[0], list(configs)
        self.draws, self.adaptations, self.runs = draws, adaptations, len(configs)
        self.device = configs[0].device
        self.compiled = should_compile(configs[0], self.relative_cost)
        if self.compiled:
            torch._dynamo.config.cache_size_limit = 64
        self._epochs: dict[Shape, training.Epoch] = {}
        if self.config.evolution.cells and not self.has_behaviours:
            raise BnsError(
                "evolution.cells is for walking and navigation; leave it out."
            )
        self.set_up()

    def set_up(self) -> None:  # noqa: B027 (nothing to do is the default)
        """Make encoding, breeder and networks, once configurations are known.

        Raises:
            BnsError: a setting that BNS cannot be with on this task.
        """

    @classmethod
    def shared(cls, config: RunConfig, first: RunConfig) -> RunConfig:
        """What all runs of a batch share; the rest as in the first."""
        return replace(
            config,
            preset=first.preset,
            adaptation=first.adaptation,
            world=first.world,
        )

    free: ClassVar[str] = "`adaptation` and `world`"
    """settings that `shared` takes from the first, in words"""

    @abstractmethod
    def begin(self) -> tuple[Population, list[Memory]]:
        """A random population and random networks."""

    def random(self) -> Population:
        """Random individuals of every row, ``(R I, P / I, ...)``."""
        size = self.config.evolution.population // self.islands
        return self.encoding.random(self.runs * self.islands, size, self.draws)

    @abstractmethod
    def cost(self, memories: Sequence[Memory], population: Population) -> Tensor:
        """Predicted cost of a population of rows, ``(R I, P / I)``."""

    @abstractmethod
    def generation(
        self,
        memories: Sequence[Memory],
        population: Population,
        cost: Tensor,
        rates: Rates,
        coins: Coins,
    ) -> tuple[Population, Tensor]:
        """The next population and its costs, from uniform numbers drawn beforehand.

        Args:
            memories: what the runs know.
            population: of all rows.
            cost: predicted, ``(R I, P / I)``.
            rates: mutation settings.
            coins: this generation's random numbers.

        Returns:
            the population, and its predicted costs ``(R I, P / I)``.
        """

    def evolve(
        self,
        memories: Sequence[Memory],
        population: Population,
        cost: Tensor,
        rates: Rates,
        generations: int,
    ) -> tuple[Population, Tensor]:
        """Some generations, one after another.

        Args:
            memories: what the runs know.
            population: of all rows.
            cost: predicted, ``(R I, P / I)``.
            rates: mutation settings.
            generations: how many.

        Returns:
            the last population, and its predicted costs ``(R I, P / I)``.
        """
        for _ in range(generations):
            coins = self.breeder.draw(self.draws, rates)
            bred = self.generation(memories, population, cost, rates, coins)
            if self.config.evolution.cells:
                bred = self._elites(memories, (population, cost), bred)
            population, cost = bred
        return population, cost

    def _elites(
        self,
        memories: Sequence[Memory],
        old: tuple[Population, Tensor],
        new: tuple[Population, Tensor],
    ) -> tuple[Population, Tensor]:
        """Of two populations and their costs, the elites of the grid's cells."""
        both = Population(
            torch.cat([old[0].genes, new[0].genes], dim=1),
            torch.cat([old[0].lengths, new[0].lengths], dim=1),
        )
        cost = torch.cat([old[1], new[1]], dim=1)
        bins = self.config.evolution.cells
        cells = selection.cells(self.behaviours(memories, both), bins)
        index = selection.survivors(cells, cost, old[1].shape[1])
        return take(both, index), cost.gather(1, index)

    def behaviours(self, memories: Sequence[Memory], population: Population) -> Tensor:
        """How, not how well, individuals do: ``(R, P, B)``, each from 0 to 1.

        Raises:
            NotImplementedError: the task has none.
        """
        raise NotImplementedError

    @abstractmethod
    def rates(self, trial: int) -> Rates:
        """Mutation settings of each row before a trial."""

    def restart(
        self, trial: int, memories: Sequence[Memory], population: Population
    ) -> Population:
        """What the task's own adaptations leave of a population before a trial.

        Args:
            trial: number of the trial that comes next, counted from 0.
            memories: what the runs know.
            population: of all rows.
        """
        del trial, memories
        return population

    def settle(
        self,
        trial: int,
        memories: Sequence[Memory],
        population: Population,
        cost: Tensor,
    ) -> tuple[Population, Tensor]:
        """What happens among islands before evolution; on most tasks nothing.

        Args:
            trial: number of the trial that comes next, counted from 0.
            memories: what the runs know.
            population: of all rows.
            cost: predicted, ``(R I, P / I)``.

        Returns:
            the population, and its predicted costs ``(R I, P / I)``.
        """
        del trial, memories
        return population, cost

    def choosing(self, trial: int) -> RunConfig:
        """The configuration whose rule chooses what is tried in a trial."""
        del trial
        return self.config

    @abstractmethod
    def disagreement(
        self, memories: Sequence[Memory], population: Population
    ) -> Tensor:
        """How far ensembles disagree on each individual of a run, ``(R, P)``."""

    @abstractmethod
    def controllers(self, chosen: Population) -> list[Any]:
        """The first individual of each run as a controller of the task."""

    @abstractmethod
    def predicted(
        self, memories: Sequence[Memory], chosen: Population, tried: Sequence[Trial]
    ) -> dict[str, np.ndarray]:
        """What the networks foresaw of the controllers tried.

        Args:
            memories: what the runs knew before the trial.
            chosen: the individuals that were tried, the first of each run.
            tried: what came of them, R trials.

        Returns:
            predicted ``(R, K + 1, 3)``, fitness_predicted ``(R,)`` and own figures.
        """

    @abstractmethod
    def patterns(self, run: int, trial: Trial) -> list[tuple[Patterns, ...]]:
        """What a trial teaches: patterns for each memory; augmented ones follow.

        Args:
            run: which.
            trial: what was observed.
        """

    @abstractmethod
    def error(
        self,
        run: int,
        trial: Trial,
        memories: Sequence[Memory],
        new: Sequence[Patterns],
    ) -> np.ndarray:
        """RMS errors of a run's networks on a trial's patterns; NaN without patterns.

        Args:
            run: which.
            trial: what was observed.
            memories: what the runs know, not yet trained on it.
            new: the trial's patterns for each memory.

        Returns:
            a number for each name in `errors`, ``(len(errors),)``.
        """

    def innovation(
        self, run: int, memories: Sequence[Memory], new: Sequence[Patterns]
    ) -> np.ndarray:
        """How surprising a trial is in each of `channels`, see `change_detection`.

        Args:
            run: which.
            memories: what the runs know, not yet trained on the trial.
            new: the trial's patterns for each memory.

        Returns:
            ``(C,)``, C channels; NaN where nothing was seen.

        Raises:
            NotImplementedError: the task has no channels.
        """
        raise NotImplementedError

    @abstractmethod
    def forget(self, run: int, memories: Sequence[Memory]) -> int:
        """Drop what is of another robot than the newest trial; how many trials went."""

    def trained(self, memories: Sequence[Memory]) -> None:  # noqa: B027
        """Take note of what the networks say after training."""

    @abstractmethod
    def diversity(self, population: Population) -> dict[str, np.ndarray]:
        """Thesis equations 4.1, 5.1 and 7.3, each ``(R,)``."""

    def train(
        self, shape: Shape, theta: Tensor, patterns: training.Patterns
    ) -> tuple[Tensor, Tensor]:
        """Train all runs' networks of a shape from fresh step sizes.

        Args:
            shape: of the networks.
            theta: weights before, ``(R, D)``.
            patterns: what to train on.

        Returns:
            new weights ``(R, D)``, and the mean squared error after training ``(R,)``.
        """
        if shape not in self._epochs:
            epoch = training.epoch_of(shape, self.config.snn)
            if self.compiled:
                epoch = torch.compile(epoch, dynamic=False)
            self._epochs[shape] = epoch
        epoch = self._epochs[shape]
        snn = self.config.snn
        return training.fit(shape, snn, theta, patterns, self.draws, epoch)

    def state(self) -> dict[str, np.ndarray]:
        """What the next trial depends on beside population and memories.

        Returns:
            name -> array, each as `restore` takes it; none by default.
        """
        return {}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:  # noqa: B027
        """Go on from `state`."""
