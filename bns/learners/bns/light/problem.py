"""BNS for light following: controllers evolve inside a motion SNN and sensor SNNs.

A trial of 100 cycles trains the motion SNN and the two sensor SNNs at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from bns.draws import Draws, whole_below
from bns.errors import BnsError
from bns.evolution.chromosome import Population
from bns.evolution.generation import Breeder, Coins, Rates
from bns.evolution.variation import normal
from bns.experiment.config import RunConfig
from bns.learners.base import Curves, Panel
from bns.learners.bns.forgetting import contradicted, newer
from bns.learners.bns.light import islands
from bns.learners.bns.light.simulator import (
    CHANNELS,
    MOTION_OUTPUTS,
    SENSORS,
    Noise,
    Simulator,
    State,
    Thetas,
    in_body,
    innovations,
    mirrored_motion,
    mirrored_sensors,
    motion_patterns,
    sensor_patterns,
)
from bns.learners.bns.memory import Memory, Patterns
from bns.learners.bns.problem import Problem
from bns.snn.network import integrate
from bns.tasks.light import LightTask
from bns.tasks.light_controller import DARK, Controllers, counts
from bns.worlds.trial import Trial

BUCKET = 512  # patterns; training tensors grow in these steps, so shapes recur

PER_RUN = ("mirror", "weights", "mutation_magnitude", "reset_every", "reset_elitists")
"""settings of `light` in which the runs of a batch may differ, as in the mutation rate
and the headless chicken of `evolution`, in `adaptation` and in `world`"""


@dataclass(frozen=True)
class Weights:
    """Genomes as the evolutionary operators take them: D places of one kind.

    Attributes:
        max_commands: weights of a genome, D.
        reach: random weights lie between - and + this, ``(R, 1, 1, 1)``.
        low, high: bounds of every weight, ``(1,)``.
    """

    max_commands: int
    reach: Tensor
    low: Tensor
    high: Tensor

    @classmethod
    def of(cls, controllers: Controllers, reach: Tensor, limit: float) -> "Weights":
        """Genomes of some controllers; `reach` is that of each row, ``(R,)``."""
        bound = torch.full((1,), limit, device=reach.device)
        return cls(controllers.genes, reach.view(-1, 1, 1, 1), -bound, bound)

    @property
    def gene_shape(self) -> tuple[int, int]:
        """Genes of an individual: places times kinds."""
        return self.max_commands, 1

    def random(self, rows: int, population: int, draws: Draws) -> Population:
        """Uniformly random weights.

        Args:
            rows: R I, the islands of all runs.
            population: P, individuals of each row.
            draws: source of randomness.
        """
        coins = draws.uniform(rows, population, *self.gene_shape)
        return self.individuals(coins, coins[..., 0, 0])

    def individuals(self, coins: Tensor, coins_lengths: Tensor) -> Population:
        """Random individuals from uniform numbers ``(R, P, D, 1)``."""
        lengths = torch.full_like(coins_lengths, self.max_commands, dtype=torch.long)
        return Population((2 * coins - 1) * self.reach, lengths)


class LightProblem(Problem):
    """BNS for closed loops from light readings to wheels (investigations B and C).

    Raises:
        BnsError: islands that cannot share the population, or of which none lives on.
    """

    stream = "light-learner"
    channels = CHANNELS
    relative_cost = 80.0  # 100 cycles, ten starts
    columns: ClassVar[Mapping[str, str]] = {
        "sensor_left": "RMS error of the left sensor's SNN on this trial [counts]",
        "sensor_right": "the same of the right one [counts]",
        "sensor_loss": "mean squared training error of the sensor SNNs",
        "sensor_patterns": "patterns they were trained on",
    }
    figures = (
        Curves(
            name="sensor_error",
            title="Error of the sensor networks",
            caption=(
                "How wrong the two sensor SNNs were about each trial before they were "
                "trained on it, per reading. A part of it is the sensors' own noise. "
                "{band}"
            ),
            label="RMS error per reading",
            panels=(
                Panel("sensor_left", "left sensor [counts]"),
                Panel("sensor_right", "right sensor [counts]"),
            ),
            log=True,
            shared=True,
            compared=False,
        ),
    )
    errors = ("snn_forward", "snn_left", "snn_turn", "sensor_left", "sensor_right")
    free = (
        "`adaptation`, `world`, "
        + ", ".join(f"`light.{name}`" for name in PER_RUN)
        + ", `evolution.mutation_rate` and `evolution.headless_chicken`"
    )
    encoding: Weights
    task: LightTask

    def set_up(self) -> None:
        """See `Problem.set_up`."""
        config, light = self.config, self.config.light
        check_islands(config)
        self.islands = light.islands
        self.simulator = Simulator.of(config)
        islanders = config.evolution.population // light.islands
        reach = self._rows([c.light.weights for c in self.configs])
        self.encoding = Weights.of(
            self.simulator.controllers, reach, light.weight_limit
        )
        evolution = replace(
            config.evolution,
            population=islanders,
            elitism=min(config.evolution.elitism, islanders),
            tournament=min(config.evolution.tournament, islanders),
            headless_chicken=max(c.evolution.headless_chicken for c in self.configs),
        )
        self.breeder = Breeder(evolution, self.encoding, True)
        pool = self.task.goal.start_pool()
        self._pool = torch.from_numpy(pool).float().to(self.device)
        self._advance = self.simulator.advance
        if self.compiled:
            self._advance = torch.compile(self.simulator.advance, dynamic=False)

    @classmethod
    def shared(cls, config: RunConfig, first: RunConfig) -> RunConfig:
        """See `Problem.shared`."""
        same = {name: getattr(first.light, name) for name in PER_RUN}
        return replace(
            super().shared(config, first),
            light=replace(config.light, **same),
            evolution=replace(
                config.evolution,
                mutation_rate=first.evolution.mutation_rate,
                headless_chicken=first.evolution.headless_chicken,
            ),
        )

    def _rows(self, values: Sequence[float] | np.ndarray) -> Tensor:
        """A setting of each run as one of each row (island), ``(R I,)``."""
        rows = np.repeat(np.asarray(values, np.float32), self.islands)
        return torch.from_numpy(rows).to(self.device)

    def begin(self) -> tuple[Population, list[Memory]]:
        """See `Problem.begin`."""
        windows, batch = self.adaptations.windows, self.config.light.batch
        made = [
            Memory(
                name, shape, targets, windows, self.draws,
                bucket=BUCKET, batch=batch, prefix=prefix,
            )
            for name, shape, targets, prefix in (
                ("motion", self.simulator.motion, MOTION_OUTPUTS, ""),
                ("sensors", self.simulator.sensors, SENSORS, "sensor_"),
            )
        ]  # fmt: skip
        return self.random(), made

    def starts(self, runs: int) -> Tensor:
        """Random starts, shared by all individuals of a run: ``(R, S, 2)`` [m]."""
        coins = self.draws.uniform(runs, self.config.light.starts)
        return self._pool[whole_below(coins, len(self._pool))]

    def noise(self, spread: Sequence[Tensor]) -> list[Noise] | list[None]:
        """Normal noise of every cycle, shared by all individuals of a run.

        Args:
            spread: what the SNNs err by on their patterns, ``(R, 3)`` and ``(R, 2)``.
        """
        light = self.config.light
        if light.noise == 0:
            return [None] * light.cycles
        drawn = []
        for part in spread:
            runs, outputs = part.shape
            coins = self.draws.uniform(light.cycles, runs, outputs, light.starts, 1)
            scale = light.noise * part[:, :, None, None]
            drawn.append(normal(coins) * scale)
        return [Noise(*pair) for pair in zip(*drawn, strict=True)]

    def _begin(self, genomes: Tensor) -> tuple[tuple[Tensor, ...], State]:
        """Controllers of genomes ``(R, P, D)``, and their robots at fresh starts."""
        runs, count, _ = genomes.shape
        starts = self.starts(runs).unsqueeze(-1).expand(-1, -1, -1, count)
        ahead, left = starts[:, :, 0].contiguous(), starts[:, :, 1].contiguous()
        layers = self.simulator.controllers.layers(genomes)
        return layers, self.simulator.begin(ahead, left)

    def cost(self, memories: Sequence[Memory], population: Population) -> Tensor:
        """See `Problem.cost`: from fresh starts."""
        rows, size = population.lengths.shape
        genomes = population.genes.reshape(self.runs, -1, population.genes.shape[2])
        layers, state = self._begin(genomes)
        thetas = _thetas(memories)
        for noise in self.noise([memory.spread for memory in memories]):
            state = self._advance(thetas, layers, state, noise)
        return (state.error / state.begun).mean(1).reshape(rows, size)

    def generation(
        self,
        memories: Sequence[Memory],
        population: Population,
        cost: Tensor,
        rates: Rates,
        coins: Coins,
    ) -> tuple[Population, Tensor]:
        """See `Problem.generation`."""
        limit = self.config.light.weight_limit
        population = self.breeder.breed(population, cost, rates, coins)
        genes = population.genes.clamp(-limit, limit)  # SBX spreads without end
        population = population._replace(genes=genes)
        return population, self.cost(memories, population)

    def rates(self, trial: int) -> Rates:
        """See `Problem.rates`."""
        rate, _ = self.adaptations.mutation(trial)
        usual = [config.light.mutation_magnitude for config in self.configs]
        size = self.adaptations.magnitudes(trial, usual)
        chicken = [config.evolution.headless_chicken for config in self.configs]
        return Rates(
            self._rows(rate), self._rows(size).unsqueeze(1), self._rows(chicken)
        )

    def restart(
        self, trial: int, memories: Sequence[Memory], population: Population
    ) -> Population:
        """See `Problem.restart`; fresh random populations now and then, but for the
        elitists (B2)."""
        every = np.array([config.light.reset_every for config in self.configs])
        turn = (every > 0) & (trial > 0) & (trial % np.maximum(every, 1) == 0)
        if not turn.any():
            return population
        fresh, old = self.random().genes, population.genes
        cost = self.cost(memories, population)
        wanted = [config.light.reset_elitists for config in self.configs]
        fresh = islands.with_elitists(fresh, old, cost, wanted)
        return _replaced(population, self._rows(turn).bool(), fresh)

    def settle(
        self,
        trial: int,
        memories: Sequence[Memory],
        population: Population,
        cost: Tensor,
    ) -> tuple[Population, Tensor]:
        """See `Problem.settle`; migrants go and the worst islands start anew."""
        light = self.config.light
        if trial > 0 and trial % light.migration_every == 0:
            population = islands.migrate(population, cost, light, self.draws)
            cost = self.cost(memories, population)
        if light.renewed:
            fresh = self.random().genes
            worst = islands.worst_islands(cost, light.islands, light.renewed)
            population = _replaced(population, worst, fresh)
            cost = self.cost(memories, population)
        return population, cost

    def disagreement(
        self, memories: Sequence[Memory], population: Population
    ) -> Tensor:
        """See `Problem.disagreement`: on the way from fresh starts."""
        thetas = _thetas(memories)
        layers, state = self._begin(population.genes.squeeze(-1))
        total = torch.zeros_like(state.error)
        for _ in range(self.config.light.cycles):
            after = self._advance(thetas, layers, state, None)
            total += self.simulator.disagreement(thetas, state, after)
            state = after
        return total.mean(1)

    def controllers(self, chosen: Population) -> list[Any]:
        """See `Problem.controllers`."""
        return self.task.attempts(chosen.genes[:, 0, :, 0])

    def predicted(
        self, memories: Sequence[Memory], chosen: Population, tried: Sequence[Trial]
    ) -> dict[str, np.ndarray]:
        """See `Problem.predicted`: from the trials' own starts; beside,
        readings_predicted ``(R, K + 1, 2)`` [counts]."""
        simulator, goal, thetas = self.simulator, self.task.goal, _thetas(memories)
        genomes = chosen.genes[:, 0, :, 0]
        begin = np.stack([trial.command_poses_world[0] for trial in tried])
        begin = np.nan_to_num(begin)
        lamp = torch.from_numpy(in_body(begin, goal.lamp)).to(genomes)
        layers = simulator.controllers.layers(genomes.unsqueeze(1))
        state = simulator.begin(lamp[:, 0, None, None], lamp[:, 1, None, None])
        moved, read = [], []
        for _ in range(len(tried[0].commands)):
            state, seen = simulator.step(thetas, layers, state)
            moved.append(seen.moved[..., 0, 0])
            read.append(seen.brightness[..., 0, 0])
        read.append(simulator.look(thetas, state)[..., 0, 0])
        steps = torch.stack(moved, dim=2).double().cpu()  # (R, 3, K)
        paths = []
        for (ahead, left, turn), pose in zip(steps, begin, strict=True):
            x, y, yaw = (float(value) for value in pose)
            path = integrate(ahead, left, turn, (x, y, yaw))
            paths.append(np.vstack([pose, np.stack(path, axis=1)]))
        predicted = np.stack(paths)
        bright = torch.stack(read, dim=1).double().cpu().numpy()
        return {
            "predicted": predicted,
            "readings_predicted": counts(bright),
            "fitness_predicted": goal.cost(predicted[..., :2]),
        }

    def patterns(self, run: int, trial: Trial) -> list[tuple[Patterns, ...]]:
        """See `Problem.patterns`: of motion and of sensors, then mirrored."""
        moved = motion_patterns(trial, self.simulator.scales)
        light = sensor_patterns(trial, self.task.goal.lamp)
        both = [(moved, self._views(light))]
        if self.configs[run].light.mirror:
            mirrored = mirrored_sensors(light)
            both.append((mirrored_motion(moved), self._views(mirrored)))
        return list(both)

    def _views(self, light: Patterns) -> Patterns:
        """Sensor patterns with the inputs that the SNNs take."""
        ahead, left = torch.from_numpy(light.inputs.T)
        views = self.simulator.views(ahead, left).T.numpy()
        return light._replace(inputs=views)

    def error(
        self,
        run: int,
        trial: Trial,
        memories: Sequence[Memory],
        new: Sequence[Patterns],
    ) -> np.ndarray:
        """See `Problem.error`: of one cycle's motion [m, m, rad] and of one reading
        [counts]."""
        del trial
        parts = []
        for memory, part, unit in zip(
            memories, new, (self.simulator.scales.moved, (DARK, DARK)), strict=True
        ):
            off = memory.error(run, part) * unit
            rms = np.sqrt(np.mean(off**2, axis=0)) if len(off) else None
            parts.append(np.full(len(unit), np.nan) if rms is None else rms)
        return np.concatenate(parts)

    def innovation(
        self, run: int, memories: Sequence[Memory], new: Sequence[Patterns]
    ) -> np.ndarray:
        """See `Problem.innovation`."""
        (motion, sensors), (moved, light) = memories, new
        watch = self.config.watch
        return innovations(motion, moved, sensors, light, run, watch)

    def forget(self, run: int, memories: Sequence[Memory]) -> int:
        """See `Problem.forget`; each memory for itself."""
        total = 0
        for memory in memories:
            marks, watch = memory.trials[run], self.config.watch
            gone = contradicted(*memory.patterns(run), marks, watch)
            memory.keep(run, newer(marks, gone))
            total += len(gone)
        return total

    def diversity(self, population: Population) -> dict[str, np.ndarray]:
        """See `Problem.diversity`: of weights as they are."""
        genes = population.genes
        genomes = genes.reshape(self.runs, -1, genes.shape[2]).double()
        apart = genomes - genomes.mean(1, keepdim=True)
        total = apart.abs().sum((1, 2))
        measures = {
            "diversity_41": total,
            "diversity_51": apart.square().sum((1, 2)),
            "diversity_73": total.clamp(min=1e-12).log(),
        }
        return {name: value.cpu().numpy() for name, value in measures.items()}


def check_islands(config: RunConfig) -> None:
    """Refuse islands that cannot share the population, or of which none lives on.

    Raises:
        BnsError: so many.
    """
    light, population = config.light, config.evolution.population
    if population % light.islands:
        raise BnsError(
            f"evolution.population = {population} cannot be shared alike by "
            f"light.islands = {light.islands}; take a multiple."
        )
    if 0 < light.renewed >= light.islands:
        raise BnsError(
            f"light.renewed = {light.renewed} would start all of light.islands = "
            f"{light.islands} anew before each trial, and nothing would be learned: "
            "take fewer, or more islands."
        )


def _thetas(memories: Sequence[Memory]) -> Thetas:
    motion, sensors = memories
    return Thetas(motion.theta, sensors.theta)


def _replaced(population: Population, rows: Tensor, fresh: Tensor) -> Population:
    """Other genes in some rows (islands), ``(R I,)`` bool."""
    old = population.genes
    genes = torch.where(rows[:, None, None, None], fresh, old)
    return population._replace(genes=genes)
