"""BNS for lists of commands, and on wheels: commands -> predicted path -> cost."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from bns.evolution import generation
from bns.evolution.chromosome import Encoding, Population
from bns.evolution.generation import Breeder, Coins, Genes, Rates
from bns.learners.bns.change_detection import Ground, Misses, innovation
from bns.learners.bns.forgetting import contradicted, newer
from bns.learners.bns.memory import Memory, Patterns
from bns.learners.bns.problem import Problem
from bns.snn.network import AXLE, OUTPUTS, Scaling, Shape, forward, integrate, predict
from bns.tasks.base import BOARD
from bns.tasks.navigation import PathGoal, WheeledTask
from bns.worlds.trial import Trial, body_displacements

SHARP = 2.5  # [rad] commands that turn further do not tell how far each wheel rolled


class CommandGenes(Genes, Protocol):
    """Genes that mean lists of commands."""

    def commands(self, individual: Population) -> list[Any]:
        """The first individual of each run as commands for a world."""


class PathEvaluator(Protocol):
    """What lists of commands are worth according to networks."""

    def inputs(self, population: Population) -> Tensor:
        """Scaled network inputs, ``(R, I, K * P)``, the individual varying fastest."""

    def judge(
        self, theta: Tensor, inputs: Tensor, lengths: Tensor, *, fused: bool = False
    ) -> Tensor:
        """Predicted cost ``(R, P)`` from inputs.

        Args:
            theta: weights ``(R, D)``.
            inputs: as `inputs` gives them, ``(R, I, K * P)``.
            lengths: commands in each list, ``(R, P)``.
            fused: use the form meant for compilation.
        """

    def cost(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted cost of a population, ``(R, P)``."""

    def poses(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted poses at the start and after each command, ``(R, P, K + 1, 3)``."""

    def disagreement(self, theta: Tensor, population: Population) -> Tensor:
        """How far an ensemble disagrees, ``(R, P)``."""


class OpenLoopProblem(Problem):
    """BNS for lists of commands: one stack of networks foresees each one's motion."""

    encoding: CommandGenes
    shape: Shape
    evaluator: PathEvaluator
    output: Tensor
    """scale of the networks' outputs, ``(3,)`` [m, m, rad]"""
    bucket = 64
    """patterns; training tensors grow in steps of so many"""

    def _compile(self) -> None:
        self._breed, self._judge = self._bred, self.evaluator.judge
        if self.compiled and self.relative_cost:
            # two regions: in one, the compiler would compute the inputs anew for
            # every hidden neuron
            self._breed = torch.compile(self._bred, dynamic=False)
            judge = partial(self.evaluator.judge, fused=True)
            self._judge = torch.compile(judge, dynamic=False)

    def begin(self) -> tuple[Population, list[Memory]]:
        """See `Problem.begin`."""
        population = self.random()
        memory = Memory(
            "motion",
            self.shape,
            OUTPUTS,
            self.adaptations.windows,
            self.draws,
            bucket=self.bucket,
        )
        return population, [memory]

    def cost(self, memories: Sequence[Memory], population: Population) -> Tensor:
        """See `Problem.cost`."""
        return self.evaluator.cost(memories[0].theta, population)

    def _bred(
        self, population: Population, cost: Tensor, rates: Rates, coins: Coins
    ) -> tuple[Population, Tensor]:
        bred = self.breeder.breed(population, cost, rates, coins)
        return bred, self.evaluator.inputs(bred)

    def generation(
        self,
        memories: Sequence[Memory],
        population: Population,
        cost: Tensor,
        rates: Rates,
        coins: Coins,
    ) -> tuple[Population, Tensor]:
        """See `Problem.generation`."""
        population, inputs = self._breed(population, cost, rates, coins)
        theta = memories[0].theta
        return population, self._judge(theta, inputs, population.lengths)

    def disagreement(
        self, memories: Sequence[Memory], population: Population
    ) -> Tensor:
        """See `Problem.disagreement`."""
        return self.evaluator.disagreement(memories[0].theta, population)

    def controllers(self, chosen: Population) -> list[Any]:
        """See `Problem.controllers`."""
        return self.encoding.commands(chosen)

    def predicted(
        self, memories: Sequence[Memory], chosen: Population, tried: Sequence[Trial]
    ) -> dict[str, np.ndarray]:
        """See `Problem.predicted`."""
        theta = memories[0].theta
        poses = self.evaluator.poses(theta, chosen)[:, 0].double().cpu().numpy()
        for run, trial in enumerate(tried):
            poses[run, len(trial.commands) + 1 :] = np.nan
        cost = self.evaluator.cost(theta, chosen)[:, 0]
        return {"predicted": poses, "fitness_predicted": cost.double().cpu().numpy()}

    def inputs_and_motion(self, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
        """Scaled inputs ``(K, I)`` and displacements ``(K, 3)`` [m, m, rad]."""
        raise NotImplementedError

    def patterns(self, run: int, trial: Trial) -> list[tuple[Patterns, ...]]:
        """See `Problem.patterns`."""
        del run
        inputs, moved = self.inputs_and_motion(trial)
        return [(Patterns(inputs, moved / self.output.cpu().numpy()),)]

    def foreseen(self, memory: Memory, run: int, inputs: np.ndarray) -> np.ndarray:
        """Scaled motions that a run foresees, ``(K, 3)``.

        Args:
            memory: its networks'.
            run: its number.
            inputs: scaled, ``(K, I)``.
        """
        return memory.predict(run, inputs)

    def error(
        self,
        run: int,
        trial: Trial,
        memories: Sequence[Memory],
        new: Sequence[Patterns],
    ) -> np.ndarray:
        """See `Problem.error`: [m, m, rad]."""
        inputs, moved = self.inputs_and_motion(trial)
        if len(inputs) == 0:
            return np.full(OUTPUTS, np.nan)
        said = self.foreseen(memories[0], run, inputs) * self.output.cpu().numpy()
        found: np.ndarray = np.sqrt(np.mean((said - moved) ** 2, axis=0))
        return found

    def diversity(self, population: Population) -> dict[str, np.ndarray]:
        """See `Problem.diversity`."""
        found = generation.measures(population, self.encoding)
        return {name: value.double().cpu().numpy() for name, value in found.items()}


@dataclass(frozen=True)
class Evaluator:
    """What a population is worth according to the SNN.

    A command's effect depends on the one before it alone, so all commands of all
    individuals are predicted at once; only composing them is sequential. Inside, the
    individual is the last axis, so that every step works on contiguous memory.
    """

    encoding: Encoding
    scaling: Scaling
    shape: Shape
    goal: PathGoal

    def inputs(self, population: Population) -> Tensor:
        """Scaled network inputs, ``(R, 5, K * P)``, the individual varying fastest."""
        decoded = self.encoding.decode(population.genes)
        scaled = self.scaling.inputs(decoded)
        return scaled.permute(0, 3, 2, 1).flatten(2).contiguous()

    def path(
        self, theta: Tensor, inputs: Tensor, lengths: Tensor, *, fused: bool = False
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Predicted x, y [m] and yaw [rad] after each command, each ``(R, K, P)``.

        Beyond a list's end the robot stands.

        Args:
            theta: weights ``(R, D)``.
            inputs: as `inputs` gives them.
            lengths: commands of each individual ``(R, P)``.
            fused: use the form of the network meant for compilation.
        """
        outputs = predict(self.shape, theta, inputs, fused=fused)
        return self.composed(outputs, lengths)

    def composed(
        self, outputs: Tensor, lengths: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """The path that scaled outputs ``(R, 3, K * P)`` make; see `path`."""
        runs, count = lengths.shape
        moved = outputs.view(runs, 3, -1, count)
        places = torch.arange(moved.shape[2], device=lengths.device)[:, None]
        used = places < lengths.unsqueeze(1)
        ahead, left, turn = (
            torch.where(used, moved[:, axis] * self.scaling.output[axis], 0.0)
            for axis in range(3)
        )
        return integrate(ahead, left, turn, self.goal.start, dim=1)

    def judge(
        self, theta: Tensor, inputs: Tensor, lengths: Tensor, *, fused: bool = False
    ) -> Tensor:
        """See `PathEvaluator.judge`; arguments as in `path`."""
        x, y, yaw = (
            part.movedim(1, 0)
            for part in self.path(theta, inputs, lengths, fused=fused)
        )
        return self.goal.judge(x, y, yaw, lengths)

    def cost(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted cost of a population, ``(R, P)``."""
        return self.judge(theta, self.inputs(population), population.lengths)

    def poses(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted pose at the start and after each command, ``(R, P, K + 1, 3)``."""
        path = self.path(theta, self.inputs(population), population.lengths)
        after = torch.stack(path, dim=-1).transpose(1, 2)
        start = torch.tensor(self.goal.start, dtype=after.dtype, device=after.device)
        return torch.cat([start.expand_as(after[:, :, :1]), after], dim=2)

    def disagreement(self, theta: Tensor, population: Population) -> Tensor:
        """Variance of the ensemble's scaled predictions, summed over commands.

        Returns:
            ``(R, P)``; needs an ensemble (an SNN of kind "ensemble").
        """
        runs, count = population.lengths.shape
        outputs = forward(self.shape, theta, self.inputs(population))
        spread = outputs.var(1, unbiased=False).sum(1).view(runs, -1, count)
        return torch.where(population.valid.transpose(1, 2), spread, 0.0).sum(1)


class WheeledProblem(OpenLoopProblem):
    """BNS for lists of wheel commands (investigation A)."""

    task: WheeledTask

    stream = "learner"
    channels = ("left wheel", "right wheel")
    has_behaviours = True

    def set_up(self) -> None:
        """See `Problem.set_up`."""
        config = self.config
        self.encoding = Encoding.of(config.controller, config.device)
        self.scaling = Scaling.of(self.encoding)
        self.output = self.scaling.output
        self.shape = Shape.of(config.snn)
        goal = self.task.path_goal(config.device)
        self.evaluator = Evaluator(self.encoding, self.scaling, self.shape, goal)
        fixed = config.controller.fixed_length
        self.breeder = Breeder(config.evolution, self.encoding, fixed)
        self.usual = np.zeros((self.runs, OUTPUTS))  # RMS errors on the patterns
        self.rolled = np.zeros((self.runs, 2))  # of the ways the wheels rolled [m]
        self._compile()

    def behaviours(self, memories: Sequence[Memory], population: Population) -> Tensor:
        """See `Problem.behaviours`: where lists are predicted to end on the board."""
        ends = self.evaluator.poses(memories[0].theta, population)[:, :, -1, :2]
        half = torch.tensor(BOARD, dtype=ends.dtype, device=ends.device)
        return (ends / half + 1.0) / 2.0

    def rates(self, trial: int) -> Rates:
        """See `Problem.rates`."""
        rate, magnitude = self.adaptations.mutation(trial)
        return Rates(
            torch.from_numpy(rate).to(self.device),
            torch.from_numpy(magnitude).to(self.device),
        )

    def inputs_and_motion(self, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
        """See `OpenLoopProblem.inputs_and_motion`."""
        commands, moved = of_trial(trial)
        centre, half = self.scaling.centre.cpu(), self.scaling.half.cpu()
        return (commands - centre.numpy()) / half.numpy(), moved

    def innovation(
        self, run: int, memories: Sequence[Memory], new: Sequence[Patterns]
    ) -> np.ndarray:
        """See `Problem.innovation`: of how far each wheel rolled."""
        if not self.usual[run].any():  # nothing was learned yet
            return np.full(len(self.channels), np.nan)
        memory, (inputs, targets) = memories[0], new[0]
        mild, said, miss = self._rolled(run, memory, inputs, targets)
        learned = memory.patterns(run)
        gentle, _, known = self._rolled(run, memory, *learned)
        watch = self.config.watch
        ground = Ground.of(inputs[mild], learned.inputs[gentle], watch)
        misses = Misses(miss, said.var(0), known, self.rolled[run])
        unit = float(self.output.cpu().numpy()[0])
        return innovation(misses, ground, watch, unit=unit)

    def _rolled(
        self, run: int, memory: Memory, inputs: np.ndarray, targets: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Which patterns turn mildly; ways of the wheels there, and their errors.

        Args:
            run: which.
            memory: knows the networks.
            inputs, targets: of patterns, scaled.

        Returns:
            ``(N,)`` bool; of M of them, what each network says ``(G, M, 2)`` and how
            far they are off together ``(M, 2)`` [m].
        """
        output = self.output.cpu().numpy()
        mild = np.abs(targets[:, 2] * output[2]) < SHARP
        said = ways(self._said(run, memory, inputs[mild]) * output)
        return mild, said, said.mean(0) - ways(targets[mild] * output)

    def _off(self, run: int, memory: Memory) -> np.ndarray:
        """How far the networks are off on what a run learned, scaled, ``(N, 3)``."""
        inputs, targets = memory.patterns(run)
        found: np.ndarray = self._said(run, memory, inputs).mean(0) - targets
        return found

    def _said(self, run: int, memory: Memory, inputs: np.ndarray) -> np.ndarray:
        """Scaled outputs of each network with all of them, ``(G, N, 3)``."""
        said = memory.members(run, inputs)
        if self.shape.outputs == 1:
            said = said.transpose(0, 1)
        return said.transpose(1, 2).double().cpu().numpy()

    def forget(self, run: int, memories: Sequence[Memory]) -> int:
        """See `Problem.forget`."""
        memory, usual = memories[0], self.usual[run]
        marks = memory.trials[run]
        if not usual.any() or not len(marks):
            return 0
        off, watch = self._off(run, memory), self.config.watch
        inputs = memory.buffer.inputs[run]
        gone = contradicted(inputs, off, marks, watch, usual)
        memory.keep(run, newer(marks, gone))
        return len(gone)

    def trained(self, memories: Sequence[Memory]) -> None:
        """See `Problem.trained`; only where the robot is watched."""
        watch, memory = self.config.watch, memories[0]
        if not (watch.detect or watch.forget):
            return
        for run in range(self.runs):
            inputs, targets = memory.patterns(run)
            if len(inputs):
                self.usual[run] = _rms(self._off(run, memory))
                mild, _, far = self._rolled(run, memory, inputs, targets)
                self.rolled[run] = _rms(far) if mild.any() else 1.0

    def state(self) -> dict[str, np.ndarray]:
        """See `Problem.state`."""
        return {"usual": self.usual.copy(), "rolled": self.rolled.copy()}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Problem.restore`."""
        self.usual = arrays.get("usual", self.usual).copy()
        self.rolled = arrays.get("rolled", self.rolled).copy()


def of_trial(trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """What each command was and did, in SI units.

    Args:
        trial: commands as sent, and what was observed.

    Returns:
        commands ``(K, 5)`` (previous left, previous right, left, right [m/s],
        duration [s]) and displacements ``(K, 3)`` in the body frame [m, m, rad];
        commands whose pose was lost at either end, and diverged trials, are left out.
    """
    speeds = trial.commands.values[:, :2]
    before = np.vstack([np.zeros((1, 2)), speeds[:-1]])
    commands = np.column_stack([before, speeds, trial.commands.durations])
    moved = body_displacements(trial.command_poses_world)
    seen = np.isfinite(moved).all(1) & trial.outcome.usable
    return commands[seen], moved[seen]


def ways(moved: np.ndarray) -> np.ndarray:
    """How far the left and the right wheel rolled in commands that turn mildly.

    Args:
        moved: displacements in the body frame, ``(..., 3)`` [m, m, rad].

    Returns:
        ``(..., 2)`` [m], of an arc with that chord.
    """
    forward, left, turn = np.moveaxis(moved, -1, 0)
    half = np.clip(turn / 2, -SHARP, SHARP)
    along = forward * np.cos(half) + left * np.sin(half)  # on the chord's direction
    arc = along / np.sinc(half / np.pi)
    return np.stack([arc - AXLE / 2 * turn, arc + AXLE / 2 * turn], axis=-1)


def _rms(error: np.ndarray) -> np.ndarray:
    rms: np.ndarray = np.sqrt(np.mean(error**2, axis=0))
    return rms
