"""Bootstrapped Neuro-Simulation: evolve in the SNN, try in the world, train, repeat.

One `Learner` holds R runs that advance in lockstep (thesis 2.8, Figure 2.16). It
meets the world only through commands and trials: `propose` gives what to try, the
caller runs it, `observe` learns from what came back.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
import torch
from torch import Tensor

from bns import choice, patterns, seeding
from bns.adaptation import Adaptations
from bns.chromosome import Encoding, Population
from bns.draws import Draws
from bns.errors import BnsError
from bns.evaluation import Evaluator
from bns.evolution import diversity
from bns.evolution.generation import Breeder, Rates
from bns.experiment.config import RunConfig
from bns.inner import InnerLoops
from bns.snn.network import Shape, predict
from bns.snn.scaling import Scaling
from bns.tasks import NavigationTask
from bns.tasks.trials import score_trials
from bns.worlds.trial import Trial

Controller = TypeVar("Controller")  # a list of commands, or a policy's genome


@dataclass(frozen=True)
class Proposal(Generic[Controller]):
    """What to run in the world.

    Attributes:
        tried: the controller each run learns from, R of them.
        best: the population's best, where that is another one: to be measured, not
            learned from and not charged; else None.
    """

    tried: list[Controller]
    best: list[Controller] | None


class Learner:
    """R runs of BNS as one tensor program.

    Args:
        configs: one per run; they may differ in `adaptation`, `seed` and world, all
            else must agree.
        replicates: number of each run, part of its identity.
        onsets: first damaged trial of each run, -1 = none; only the adaptations that
            are *told* about damage use it.

    Raises:
        BnsError: configurations that cannot share a batch.
    """

    def __init__(
        self,
        configs: Sequence[RunConfig],
        *,
        replicates: Sequence[int],
        onsets: Sequence[int],
    ):
        config = configs[0]
        check_alike(configs)
        torch.set_num_threads(config.threads)
        self.config = config
        self.runs = len(configs)
        self.draws = Draws(
            seeding.integer(config.seed, "learner", *replicates), config.device
        )
        self.encoding = Encoding.of(config.controller, config.device)
        self.scaling = Scaling.of(self.encoding)
        self.task = NavigationTask.of(config.task, config.device)
        self.shape = Shape.of(config.snn)
        self.evaluator = Evaluator(self.encoding, self.scaling, self.shape, self.task)
        fixed = config.controller.fixed_length
        breeder = Breeder(config.evolution, self.encoding, fixed)
        self.inner = InnerLoops(config, self.evaluator, breeder, self.draws)
        self.adaptations = Adaptations(configs, onsets)
        self.buffer = patterns.PatternBuffer(self.runs, self.adaptations.windows)
        self.population = self._random_population()
        self.theta = self.shape.random(self.runs, self.draws)
        self.loss = torch.full((self.runs,), torch.nan)
        self.cost: Tensor | None = None
        self._chosen = self.population.pick(torch.zeros(self.runs, dtype=torch.long))

    def _random_population(self) -> Population:
        size = self.config.evolution.population
        return self.encoding.random(self.runs, size, self.draws)

    def propose(self, trial: int) -> Proposal:
        """Adapt, evolve inside the SNN, and choose what to try in trial `trial`."""
        with self.draws.aside("resets", trial):
            self._reset(trial)
        self.cost = self.inner.cost(self.theta, self.population)
        if trial >= self.config.evolve_from:
            self.population, self.cost = self.inner.evolve(
                self.theta, self.population, self.cost, self._rates(trial)
            )
        index = choice.choose(
            self._choosing(trial), trial, self.cost, self.population, self.theta,
            self.evaluator, self.draws,
        )  # fmt: skip
        self._chosen = self.population.pick(index)
        best = self.cost.argmin(1)
        tried = self.encoding.commands(self._chosen)
        if torch.equal(best, index):
            return Proposal(tried, None)
        return Proposal(tried, self.encoding.commands(self.population.pick(best)))

    def _choosing(self, trial: int) -> RunConfig:
        """The configuration whose rule chooses what to try in a trial."""
        del trial
        return self.config

    def _rates(self, trial: int) -> Rates:
        rate, magnitude = self.adaptations.mutation(trial)
        device = self.config.device
        return Rates(
            torch.from_numpy(rate).to(device), torch.from_numpy(magnitude).to(device)
        )

    def _reset(self, trial: int) -> None:
        resets = self.adaptations.resets(trial)
        if resets.population.any():
            which = torch.from_numpy(resets.population).to(self.config.device)
            fresh, old = self._random_population(), self.population
            self.population = Population(
                torch.where(which[:, None, None, None], fresh.genes, old.genes),
                torch.where(which[:, None], fresh.lengths, old.lengths),
            )
        for run in np.flatnonzero(resets.data):
            self.buffer.clear(run)
        if resets.simulator.any():
            which = torch.from_numpy(resets.simulator).to(self.config.device)
            fresh_theta = self.shape.random(self.runs, self.draws)
            self.theta = torch.where(which[:, None], fresh_theta, self.theta)
            due = resets.trained & (self.buffer.counts > 0)
            self._train(torch.from_numpy(due).to(which))

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """Learn from a trial of every run.

        Args:
            trial: its number.
            tried: R trials of the proposed controllers.
            best: R trials of the population's best where they were asked for.

        Returns:
            The columns of `RunRecord`, each ``(R,)`` (all but `damaged`), and "sent"
            ``(R, K, 3)``, "poses" and "predicted" ``(R, K + 1, 3)``.
        """
        row = self._measured(tried, best)
        row["fitness_predicted"] = self._predicted_cost()
        row.update(self._learn(tried))
        row["snn_loss"] = self.loss.cpu().numpy().astype(np.float64)
        row["patterns"] = self.buffer.counts.astype(np.float64)
        spread = diversity.measures(self.population, self.encoding)
        row.update({name: v.double().cpu().numpy() for name, v in spread.items()})
        return row

    def _predicted_cost(self) -> np.ndarray:
        cost = self.evaluator.cost(self.theta, self._chosen)[:, 0]
        return cost.double().cpu().numpy()

    def _measured(
        self, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        longest = self.config.controller.max_commands
        sent = np.full((self.runs, longest, 3), np.nan)
        poses = np.full((self.runs, longest + 1, 3), np.nan)
        for run, trial in enumerate(tried):
            count = len(trial.commands)
            sent[run, :count, :2] = trial.commands.values[:, :2]
            sent[run, :count, 2] = trial.commands.durations
            poses[run, : count + 1] = trial.command_poses_world
        predicted = self.evaluator.poses(self.theta, self._chosen)[:, 0]
        predicted = predicted.double().cpu().numpy()
        predicted[:, 1:][np.isnan(sent[..., 0])] = np.nan
        fitness, reached = self._score(tried)
        goals = self.task.goals.shape[0]
        return {
            "sent": sent,
            "poses": poses,
            "predicted": predicted,
            "fitness": fitness,
            "reached": reached,
            "solved": (reached == goals).astype(np.float64),
            "fitness_best": fitness if best is None else self._score(best)[0],
            "commands": np.array([len(t.commands) for t in tried], np.float64),
        }

    def _score(self, trials: Sequence[Trial]) -> tuple[np.ndarray, np.ndarray]:
        longest = self.config.controller.max_commands
        task = NavigationTask.of(self.config.task)
        cost, reached = score_trials(task, trials, longest)
        return cost.numpy(), reached.double().numpy()

    def _learn(self, tried: Sequence[Trial]) -> dict[str, np.ndarray]:
        """Add the patterns, say how wrong the SNN was on them, train."""
        errors = np.full((self.runs, 3), np.nan)
        output = self.scaling.output.cpu().numpy()
        for run, trial in enumerate(tried):
            scaled, moved = self._patterns(trial)
            if len(scaled) == 0:
                continue
            seen = torch.from_numpy(scaled.T.astype(np.float32)).to(self.config.device)
            said = predict(self.shape, self.theta[run : run + 1], seen[None])[0]
            miss = said.cpu().numpy().T * output - moved
            errors[run] = np.sqrt(np.mean(miss**2, axis=0))
            self.buffer.append(run, scaled, moved / output)
        if not self.config.snn.warm_start:
            self.theta = self.shape.random(self.runs, self.draws)
        self._train(torch.from_numpy(self.buffer.counts > 0))
        names = ("snn_forward", "snn_left", "snn_turn")
        return dict(zip(names, errors.T.copy(), strict=True))

    def _patterns(self, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
        """Scaled inputs ``(K, I)`` and displacements ``(K, 3)`` [m, m, rad]."""
        commands, moved = patterns.of_trial(trial)
        centre, half = self.scaling.centre.cpu(), self.scaling.half.cpu()
        return (commands - centre.numpy()) / half.numpy(), moved

    def _train(self, which: Tensor) -> None:
        """Train the SNNs of the runs marked in `which` ``(R,)`` bool."""
        if not which.any():
            return
        which = which.to(self.config.device)
        inputs, targets, weight = self.buffer.tensors(self.config.device)
        trained, loss = self.inner.train(self.theta, inputs, targets, weight)
        self.theta = torch.where(which[:, None], trained, self.theta)
        self.loss = torch.where(which.cpu(), loss.cpu(), self.loss)

    def state(self) -> dict[str, np.ndarray]:
        """All that the next trial depends on, as arrays."""
        return {
            "genes": self.population.genes.cpu().numpy(),
            "lengths": self.population.lengths.cpu().numpy(),
            "theta": self.theta.cpu().numpy(),
            "loss": self.loss.numpy(),
            "draws": self.draws.state(),
            **self.buffer.state(),
        }

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        device = self.config.device
        self.population = Population(
            torch.from_numpy(arrays["genes"]).to(device),
            torch.from_numpy(arrays["lengths"]).to(device),
        )
        self.theta = torch.from_numpy(arrays["theta"]).to(device)
        self.loss = torch.from_numpy(arrays["loss"])
        self.draws.restore(arrays["draws"])
        self.buffer.restore(arrays)


def check_alike(configs: Sequence[RunConfig]) -> None:
    """Refuse configurations that cannot share a batch.

    Raises:
        BnsError: they differ in more than `adaptation` and `world`.
    """
    first = configs[0]
    free = {name: getattr(first, name) for name in ("preset", "adaptation", "world")}
    if any(replace(config, **free) != first for config in configs):
        raise BnsError(
            "Runs of one batch may differ in `adaptation` and `world` only; "
            "train the others as a batch of their own."
        )
