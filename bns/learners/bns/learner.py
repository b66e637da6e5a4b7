"""Bootstrapped Neuro-Simulation: evolve in an SNN that each trial trains (thesis 2.8).

R runs advance in lockstep (Figure 2.16). The learner meets the world only through
controllers and trials: `propose` gives what to try, the caller runs it, `observe`
learns from what came back. What differs between tasks is in their `Problem`.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from bns import seeding
from bns.draws import Draws
from bns.errors import BnsError
from bns.evolution.chromosome import Population
from bns.experiment.config import RunConfig
from bns.learners.base import Curves, Learner, Panel, Proposal
from bns.learners.bns.adaptations import Adaptations
from bns.learners.bns.change_detection import Detector
from bns.learners.bns.choice import Deployed, Seen, choose, packed, unpack
from bns.learners.bns.config import BNS_SECTIONS
from bns.learners.bns.memory import Patterns
from bns.learners.bns.problem import Problem, should_compile
from bns.tasks import registry as tasks
from bns.tasks.base import Task
from bns.worlds.trial import Trial

CHUNK = 5
"""generations between two looks whether a trial is over, in the background"""

LEAST = 20
"""generations after a trial, with what was learned from it, in the background"""

DEGREES, MILLIMETRES = 180.0 / np.pi, 1000.0

SNN_ERROR = Curves(
    name="snn_error",
    title="Error of the simulator network",
    caption=(
        "How wrong the SNN was about each trial before it was trained on it, per "
        "command and output. It falls while the SNN learns the robot and jumps when "
        "the robot changes. {band}"
    ),
    label="RMS error per command",
    panels=(
        Panel("snn_forward", "forward [mm]", MILLIMETRES),
        Panel("snn_left", "left [mm]", MILLIMETRES),
        Panel("snn_turn", "turn [deg]", DEGREES),
    ),
    log=True,
)
DIVERSITY = Curves(
    name="diversity",
    title="Diversity of the population",
    caption=(
        "How different the controllers in the population are, by the three measures "
        "of the dissertation; the narrower, the less evolution has to choose from. "
        "{band}"
    ),
    label="diversity of the population",
    panels=(
        Panel("diversity_41", "equation 4.1"),
        Panel("diversity_51", "equation 5.1"),
        Panel("diversity_73", "equation 7.3"),
    ),
)


class Bns(Learner):
    """R runs of BNS as one tensor program; arguments as `Learner`.

    With `watch.detect` nobody is told the onsets; the adaptations to damage follow
    what is detected. With `watch.forget` patterns of the robot before it changed are
    dropped. With
    `deploy` = "seen" what was seen to work is held on to.
    """

    sections: ClassVar[tuple[str, ...]] = BNS_SECTIONS
    columns: ClassVar[Mapping[str, str]] = {
        "fitness_predicted": "of the controller tried, inside the SNN before the trial",
        "snn_forward": "RMS error of the SNN on this trial before training on it [m]",
        "snn_left": "the same to the left [m]",
        "snn_turn": "the same of the turn [rad]",
        "snn_loss": "mean squared training error after training (scaled outputs)",
        "patterns": "patterns the SNN was trained on",
        "diversity_41": "thesis equation 4.1",
        "diversity_51": "thesis equation 5.1",
        "diversity_73": "thesis equation 7.3",
    }
    open_columns = True
    figures: ClassVar[tuple[Curves | str, ...]] = (
        SNN_ERROR,
        "displacement",
        DIVERSITY,
    )

    def begin(self) -> None:
        """See `Learner.begin`.

        Raises:
            BnsError: detection of damage where there is nothing to detect it in.
        """
        config, kind = self.config, self.kind(self.task)
        torch.set_num_threads(config.threads)
        watch = config.watch
        if watch.detect and not kind.channels:
            raise BnsError(
                "watch.detect is for navigation and light following; leave it out. "
                "watch.forget is for walking, too."
            )
        self.draws = Draws(
            seeding.integer(config.seed, kind.stream, *self.replicates), config.device
        )
        told = [-1] * self.runs if watch.detect else self.onsets
        self.adaptations = Adaptations(self.configs, told)
        self.detector = Detector.fresh(watch, self.runs, len(kind.channels))
        self.problem = kind(self.task, self.configs, self.draws, self.adaptations)
        self.population, self.memories = self.problem.begin()
        self.cost = torch.empty(0)
        self._chosen = self._by_run(self.population).pick(
            torch.zeros(self.runs, dtype=torch.long)
        )
        self._background, self._trial, self._generations = False, 0, 0
        self.deploys = config.deploy == "seen"
        repeatable = not self.task.closed_loop
        self.deployed = [Deployed(repeatable) for _ in range(self.runs)]

    def check_alike(self, configs: Sequence[RunConfig]) -> None:
        """See `Learner.check_alike`; more is free in light following."""
        task = tasks.of(configs[0])
        kind = self.kind(task)
        first = kind.shared(configs[0], configs[0])
        if any(kind.shared(config, configs[0]) != first for config in configs):
            raise BnsError(
                f"Runs of one batch of {task.picture.name} may differ in {kind.free} "
                "only; train the others as a batch of their own."
            )

    @classmethod
    def kind(cls, task: Task) -> type[Problem]:
        """How a task is seen; what is another way to evolve in the SNNs has its own.

        Raises:
            BnsError: the task cannot be learned so.
        """
        return task.problem()

    @classmethod
    def figures_of(cls, task: Task) -> list[Curves | str]:
        """See `Learner.figures_of`; beside, those of the task's networks."""
        first, *others = cls.figures
        return [first, *cls.kind(task).figures, *others]

    @classmethod
    def compiles(cls, config: RunConfig) -> bool:
        """See `Learner.compiles`.

        Raises:
            MissingDependencyError: asked for, but there is no C++ compiler.
        """
        return should_compile(config, cls.kind(tasks.of(config)).relative_cost)

    @property
    def theta(self) -> Tensor:
        """Weights of the motion networks, ``(R, D)``."""
        return self.memories[0].theta

    def _by_run(self, population: Population) -> Population:
        """The islands of a run side by side."""
        genes, lengths = population
        return Population(
            genes.reshape(self.runs, -1, *genes.shape[2:]),
            lengths.reshape(self.runs, -1),
        )

    def propose(self, trial: int) -> Proposal[Any]:
        """Adapt, evolve inside the SNN, and choose what to try in trial `trial`."""
        with self.draws.aside("resets", trial):
            self._reset(trial)
        self.cost = self.problem.cost(self.memories, self.population)
        if self.deploys:
            self._keep_deployed()
        if trial >= self.config.evolve_from:
            self._settle(trial)
            if not self._background:
                self._evolve(trial, self.config.evolution.generations)
        self._trial, self._generations = trial, 0
        return self._proposal(trial, self.cost.reshape(self.runs, -1))

    def _proposal(self, trial: int, cost: Tensor) -> Proposal[Any]:
        problem, whole = self.problem, self._by_run(self.population)
        index = choose(
            problem.choosing(trial), trial, cost, self.draws,
            lambda: problem.disagreement(self.memories, whole),
        )  # fmt: skip
        self._chosen, best = whole.pick(index), cost.argmin(1)
        if self.deploys:
            return self._deploying(trial, whole.pick(best))
        tried = problem.controllers(self._chosen)
        if torch.equal(best, index):
            return Proposal(tried, None)
        return Proposal(tried, problem.controllers(whole.pick(best)))

    def _deploying(self, trial: int, predicted: Population) -> Proposal[Any]:
        """What is tried, in doubt again, and what was seen to work best.

        Args:
            trial: its number.
            predicted: the population's best of each run, deployed where nothing was
                seen since the robot changed.
        """
        again = [run.wanted(trial) for run in self.deployed]
        self._chosen = _with(self._chosen, again)
        best = _with(predicted, [run.best for run in self.deployed])
        return Proposal(
            self.problem.controllers(self._chosen), self.problem.controllers(best)
        )

    def _keep_deployed(self) -> None:
        """Let those that were seen to work live in the populations."""
        genes, lengths = (part.clone() for part in self.population)
        worst = self.cost.argmax(1)
        for run, kept in enumerate(self.deployed):
            row, best = run * self.problem.islands, kept.best
            if best is not None:
                genes[row, worst[row]] = torch.from_numpy(best.genes).to(genes)
                lengths[row, worst[row]] = best.length
        self.population = Population(genes, lengths)
        self.cost = self.problem.cost(self.memories, self.population)

    def _note(self, trial: int, cost: np.ndarray, row: Mapping[str, Any]) -> np.ndarray:
        """Take note of what was tried; whether it was tried before, ``(R,)``.

        Args:
            trial: its number.
            cost: in the world, ``(R,)``.
            row: figures of the trial.
        """
        genes, lengths = (part[:, 0].cpu().numpy() for part in self._chosen)
        for run, kept in enumerate(self.deployed):
            foreseen = float(row["fitness_predicted"][run])
            length = int(lengths[run])
            kept.note(trial, genes[run], length, float(cost[run]), foreseen)
            if row.get("forgotten", np.zeros(self.runs))[run]:
                marks = [memory.trials[run].min() for memory in self.memories]
                kept.forget(int(min(marks)), trial)
        return np.array([float(kept.again == trial) for kept in self.deployed])

    def _settle(self, trial: int) -> None:
        self.population, self.cost = self.problem.settle(
            trial, self.memories, self.population, self.cost
        )

    def _evolve(self, trial: int, generations: int) -> None:
        self.population, self.cost = self.problem.evolve(
            self.memories,
            self.population,
            self.cost,
            self.problem.rates(trial),
            generations,
        )

    def _reset(self, trial: int) -> None:
        resets = self.adaptations.resets(trial)
        if resets.population.any():
            rows = np.repeat(resets.population, self.problem.islands)
            self.population = replaced(self.population, rows, self.problem.random())
        self.population = self.problem.restart(trial, self.memories, self.population)
        for run in np.flatnonzero(resets.data):
            for memory in self.memories:
                memory.keep(int(run), 0)
        if resets.simulator.any():
            which = torch.from_numpy(resets.simulator).to(self.config.device)
            for memory in self.memories:
                fresh = memory.fresh()
                memory.theta = torch.where(which[:, None], fresh, memory.theta)
                memory.train(self.problem, resets.trained)

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`; beside, what `Problem.predicted` gives."""
        del best
        row = self.problem.predicted(self.memories, self._chosen, tried)
        row.update(self._learn(trial, tried))
        if self.deploys:
            row["retried"] = self._note(trial, self.task.fitness(tried), row)
        for memory in self.memories:
            row[f"{memory.prefix or 'snn_'}loss"] = memory.loss.double().numpy()
            row[f"{memory.prefix}patterns"] = memory.buffer.counts.astype(np.float64)
        if self._background:
            row["generations"] = self._catch_up()
        row.update(self.problem.diversity(self.population))
        return row

    def _learn(self, number: int, tried: Sequence[Trial]) -> dict[str, np.ndarray]:
        """Add the patterns, say how wrong the networks were on them, train."""
        problem, watch = self.problem, self.config.watch
        errors = np.full((self.runs, len(problem.errors)), np.nan)
        innovations = np.full((self.runs, len(problem.channels)), np.nan)
        for run, trial in enumerate(tried):
            new, *others = problem.patterns(run, trial)
            errors[run] = problem.error(run, trial, self.memories, new)
            if watch.detect:
                innovations[run] = problem.innovation(run, self.memories, new)
            if self.learns_from(number):
                self._remember(run, number, (new, *others))
        row = dict(zip(problem.errors, errors.T.copy(), strict=True))
        if watch.detect:
            onsets = self.adaptations.onsets
            row.update(self.detector.figures(number, innovations, onsets))
        self._train(row)
        return row

    def _remember(
        self, run: int, number: int, patterns: Iterable[Sequence[Patterns]]
    ) -> None:
        """Keep what a trial teaches a run, see `Problem.patterns`."""
        for parts in patterns:
            for memory, part in zip(self.memories, parts, strict=True):
                memory.append(run, number, part)

    def learns_from(self, trial: int) -> bool:
        """Whether the SNN is to know a trial; here every one."""
        del trial
        return True

    def _train(self, row: dict[str, np.ndarray]) -> None:
        """Train on what is not forgotten; adds to the row how many trials were."""
        if not self.config.snn.warm_start:
            for memory in self.memories:
                memory.theta = memory.fresh()
        if self.config.watch.forget:
            gone = [self.problem.forget(run, self.memories) for run in range(self.runs)]
            row["forgotten"] = np.array(gone, np.float64)
        for memory in self.memories:
            memory.train(self.problem, np.ones(self.runs, bool))
        self.problem.trained(self.memories)

    def run_in_background(self) -> None:
        """See `Learner.run_in_background`.

        How many generations there are is what the robot's time allows, at most those
        that the configuration says and `LEAST` after the trial, and is recorded
        ("generations"); so results are not reproducible bit for bit. (Without a limit a
        trial has time for two thousand: they find what the SNN gets wrong, and a
        hexapod walks half as far.)
        """
        self._background = True

    def think(self) -> bool:
        """A few generations, see `Learner.think`."""
        first, longest = self.config.evolve_from, self.config.evolution.generations
        if self._trial + 1 < first or self._generations >= longest:
            return False
        self._evolve(self._trial, CHUNK)
        self._generations += CHUNK
        return self._generations < longest

    def _catch_up(self) -> np.ndarray:
        """Generations with what was just learned; how many there were, ``(R,)``."""
        self.cost = self.problem.cost(self.memories, self.population)
        if self._trial + 1 >= self.config.evolve_from:
            self._evolve(self._trial, LEAST)
            self._generations += LEAST
        return np.full(self.runs, float(self._generations))

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`."""
        arrays = {
            "genes": self.population.genes.cpu().numpy(),
            "lengths": self.population.lengths.cpu().numpy(),
            "draws": self.draws.state(),
            "onsets": self.adaptations.onsets.copy(),
            "innovations": self.detector.past,
            **self.problem.state(),
        }
        if self.deploys:
            arrays |= packed(self.deployed, tuple(arrays["genes"].shape[2:]))
        for memory in self.memories:
            arrays |= memory.state()
        return arrays

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`; states of version 0.1 are read, too."""
        arrays = _renamed(arrays)
        device = self.config.device
        genes = torch.from_numpy(arrays["genes"]).to(device)
        lengths = arrays.get("lengths", self.population.lengths.cpu().numpy())
        self.population = Population(genes, torch.from_numpy(lengths).to(device))
        self.draws.restore(arrays["draws"])
        if self.config.watch.detect:  # else they are told, and may be another branch's
            self.adaptations.onsets = arrays["onsets"].copy()
        self.detector.past = arrays.get("innovations", self.detector.past).copy()
        self.problem.restore(arrays)
        for memory in self.memories:
            memory.restore(arrays)
        if self.deploys:
            unpack(self.deployed, arrays)


def _with(chosen: Population, kept: Sequence[Seen | None]) -> Population:
    """One individual a run, ``(R, 1, ...)``, that of `kept` where there is one."""
    genes, lengths = chosen.genes.clone(), chosen.lengths.clone()
    for run, item in enumerate(kept):
        if item is not None:
            genes[run, 0] = torch.from_numpy(item.genes).to(genes)
            lengths[run, 0] = item.length
    return Population(genes, lengths)


def replaced(population: Population, rows: np.ndarray, fresh: Population) -> Population:
    """A population with other individuals in some rows.

    Args:
        population: of all rows.
        rows: which are replaced, ``(R I,)`` bool.
        fresh: a population of the same shape, from which those rows are taken.
    """
    which = torch.from_numpy(rows).to(population.genes.device)
    return Population(
        torch.where(which[:, None, None, None], fresh.genes, population.genes),
        torch.where(which[:, None], fresh.lengths, population.lengths),
    )


def _renamed(arrays: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
    """A state of version 0.1, in which one memory had no name, as today's."""
    if "theta" not in arrays:
        return arrays
    counts = arrays["pattern_counts"]
    old = {name: value for name, value in arrays.items() if name in _NAMELESS}
    marks = arrays.get("pattern_trials", np.zeros(int(counts.sum()), np.int64))
    outputs = arrays["pattern_targets"].shape[1]
    spread = np.zeros((len(counts), outputs), np.float32)
    own = {f"motion.{name}": value for name, value in old.items()}
    watched = {
        new: arrays[name]
        for name, new in (("spread", "usual"), ("rolled", "rolled"))
        if name in arrays
    }
    return {
        **arrays,
        **own,
        "motion.trials": marks,
        "motion.spread": spread,
        **watched,
    }


_NAMELESS = ("theta", "loss", "pattern_counts", "pattern_inputs", "pattern_targets")

LEARNER = Bns
