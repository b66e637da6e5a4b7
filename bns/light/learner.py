"""BNS with closed loops: evolve controllers inside three SNNs, drive, train, repeat.

As `bns.learner.Learner`, R runs advance in lockstep; what is proposed are genomes,
and a trial of 100 cycles trains the motion SNN and the two sensor SNNs at once.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from bns import choice, seeding
from bns.adaptation import Adaptations
from bns.chromosome import Population
from bns.detection import Detector
from bns.draws import Draws
from bns.evolution.generation import Breeder, Rates
from bns.experiment.config import RunConfig
from bns.learner import Proposal
from bns.light import alike, islands, observing, patterns, resets, watching
from bns.light.controller import Weights
from bns.light.loops import LightLoops, Snns
from bns.light.memory import Learned
from bns.light.policy import Attempt
from bns.light.scaling import MOTION_OUTPUTS, SENSORS
from bns.light.simulator import Simulator, Thetas
from bns.light.task import LightTask
from bns.worlds.trial import Trial


class LightLearner:
    """R runs of BNS with closed-loop controllers as one tensor program.

    Args:
        configs: one per run; what they may differ in: `bns.light.alike`.
        replicates: number of each run, part of its identity.
        onsets: first damaged trial of each run, -1 = none.

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
        alike.check(configs)
        torch.set_num_threads(config.threads)
        self.config, self.configs, self.runs = config, list(configs), len(configs)
        self.draws = Draws(
            seeding.integer(config.seed, "light-learner", *replicates), config.device
        )
        self.task = LightTask.of(config.light)
        self.simulator = Simulator.of(config)
        islanders = config.evolution.population // config.light.islands
        reach = self._rows([c.light.weights for c in configs])
        self.weights = Weights.of(
            self.simulator.controllers, reach, config.light.weight_limit
        )
        self._size = islanders
        evolution = replace(
            config.evolution,
            population=islanders,
            elitism=min(config.evolution.elitism, islanders),
            tournament=min(config.evolution.tournament, islanders),
            headless_chicken=max(c.evolution.headless_chicken for c in configs),
        )
        breeder = Breeder(evolution, self.weights, True)
        self.loops = LightLoops(config, self.simulator, breeder, self.draws)
        watch = config.watch
        told = [-1] * self.runs if watch.detect else onsets
        self.adaptations = Adaptations(configs, told)
        self.detector = Detector.fresh(watch, self.runs, len(watching.CHANNELS))
        windows, batch = self.adaptations.windows, config.light.batch
        sim = self.simulator
        self.motion = Learned(sim.motion, MOTION_OUTPUTS, windows, batch, self.draws)
        self.sensors = Learned(sim.sensors, SENSORS, windows, batch, self.draws)
        self.population = self._random_population()
        self._chosen = self.population.genes[:: config.light.islands, 0, :, 0]

    def _rows(self, values: Sequence[float]) -> Tensor:
        """A setting of each run as one of each row (island), ``(R I,)``."""
        rows = np.repeat(np.asarray(values, np.float32), self.config.light.islands)
        return torch.from_numpy(rows).to(self.config.device)

    def _random_population(self) -> Population:
        rows = self.runs * self.config.light.islands
        return self.weights.random(rows, self._size, self.draws)

    @property
    def snns(self) -> Snns:
        """All SNNs."""
        return Snns(
            Thetas(self.motion.theta, self.sensors.theta),
            Thetas(self.motion.spread, self.sensors.spread),
        )

    def propose(self, trial: int) -> Proposal[Attempt]:
        """Adapt, evolve inside the SNNs, and choose what to try in trial `trial`."""
        with self.draws.aside("resets", trial):
            self._reset(trial)
        cost = self.loops.cost_of(self.snns, self.population)
        if trial >= self.config.evolve_from:
            cost = self._settle(trial, cost)
            self.population, cost = self.loops.evolve(
                self.snns, self.population, cost, self._rates(trial)
            )
        return self._proposal(trial, cost.reshape(self.runs, -1))

    def _settle(self, trial: int, cost: Tensor) -> Tensor:
        """Migrants go and the worst islands start anew; the costs of all after that."""
        light = self.config.light
        if trial > 0 and trial % light.migration_every == 0:
            self.population = islands.migrate(self.population, cost, light, self.draws)
            cost = self.loops.cost_of(self.snns, self.population)
        if light.renewed:
            fresh = self._random_population().genes
            worst = resets.worst_islands(cost, light.islands, light.renewed)
            self._replace(worst, fresh)
            cost = self.loops.cost_of(self.snns, self.population)
        return cost

    def _proposal(self, trial: int, cost: Tensor) -> Proposal[Attempt]:
        genomes = self.population.genes.reshape(*cost.shape, -1)
        whole = Population(genomes.unsqueeze(-1), torch.zeros_like(cost).long())
        index = choice.choose(
            self.config, trial, cost, whole, self.snns.thetas, self.loops, self.draws
        )
        rows = torch.arange(self.runs, device=index.device)
        best = cost.argmin(1)
        self._chosen = genomes[rows, index]
        tried = self._attempts(self._chosen)
        if torch.equal(best, index):
            return Proposal(tried, None)
        return Proposal(tried, self._attempts(genomes[rows, best]))

    def _attempts(self, genomes: Tensor) -> list[Attempt]:
        light = self.config.light
        return [
            Attempt(self.simulator.controllers, row, light.cycles, light.cycle)
            for row in genomes.cpu()
        ]

    def _rates(self, trial: int) -> Rates:
        rate, _ = self.adaptations.mutation(trial)
        usual = [config.light.mutation_magnitude for config in self.configs]
        size = self.adaptations.magnitudes(trial, usual)
        chicken = [config.evolution.headless_chicken for config in self.configs]
        return Rates(
            self._rows(rate), self._rows(size).unsqueeze(1), self._rows(chicken)
        )

    def _reset(self, trial: int) -> None:
        due = self.adaptations.resets(trial)
        self._restart(due.population, elitists=False)
        every = np.array([config.light.reset_every for config in self.configs])
        turn = (every > 0) & (trial > 0) & (trial % np.maximum(every, 1) == 0)
        self._restart(turn, elitists=True)
        for run in np.flatnonzero(due.data):
            self.motion.clear(run)
            self.sensors.clear(run)
        if due.simulator.any():
            which = torch.from_numpy(due.simulator).to(self.config.device)
            for learned in (self.motion, self.sensors):
                fresh = learned.fresh()
                learned.theta = torch.where(which[:, None], fresh, learned.theta)
                learned.train(self.loops, due.trained)

    def _restart(self, which: np.ndarray, *, elitists: bool) -> None:
        """Fresh random populations in some runs, but for their elitists if asked."""
        if not which.any():
            return
        fresh, old = self._random_population().genes, self.population.genes
        if elitists:
            cost = self.loops.cost_of(self.snns, self.population)
            wanted = [config.light.reset_elitists for config in self.configs]
            fresh = resets.with_elitists(fresh, old, cost, wanted)
        self._replace(self._rows(which).bool(), fresh)

    def _replace(self, rows: Tensor, fresh: Tensor) -> None:
        """Take other genes in some rows (islands), ``(R I,)`` bool."""
        old = self.population.genes
        genes = torch.where(rows[:, None, None, None], fresh, old)
        self.population = self.population._replace(genes=genes)

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """Learn from a trial of every run.

        Args:
            trial: its number.
            tried: R trials of the proposed controllers.
            best: R trials of the population's best where they were asked for.

        Returns:
            Figures, each ``(R,)``, and arrays; see `bns.light.observing`.
        """
        row = observing.measured(self.task, tried, best)
        row.update(
            observing.foreseen(
                self.simulator, self.snns.thetas, self._chosen, self.task, tried
            )
        )
        row.update(self._learn(trial, tried))
        row.update(observing.diversity(self.population.genes, self.runs))
        return row

    def _learn(self, number: int, tried: Sequence[Trial]) -> dict[str, np.ndarray]:
        """Add the patterns, say how wrong the SNNs were on them, train."""
        errors = np.full((self.runs, MOTION_OUTPUTS + SENSORS), np.nan)
        innovations = np.full((self.runs, len(watching.CHANNELS)), np.nan)
        for run, trial in enumerate(tried):
            moved = patterns.motion(trial, self.simulator.scales)
            light = patterns.sensors(trial, self.task.lamp)
            views = self._views(light)
            errors[run] = observing.errors(
                self.motion.miss(run, moved),
                self.sensors.miss(run, views),
                self.simulator.scales,
            )
            if self.config.watch.detect:
                innovations[run] = watching.innovations(
                    self.motion, moved, self.sensors, views, run, self.config.watch
                )
            self._keep(run, number, moved, light)
            if self.configs[run].light.mirror:
                self._keep(
                    run,
                    number,
                    patterns.mirrored_motion(moved),
                    patterns.mirrored_sensors(light),
                )
        watched = self._watch(number, innovations)
        for learned in (self.motion, self.sensors):
            if not self.config.snn.warm_start:
                learned.theta = learned.fresh()
            learned.train(self.loops, np.ones(self.runs, bool))
        return dict(zip(observing.ERRORS, errors.T.copy(), strict=True)) | {
            "snn_loss": self.motion.loss.numpy().astype(np.float64),
            "sensor_loss": self.sensors.loss.numpy().astype(np.float64),
            "patterns": self.motion.buffer.counts.astype(np.float64),
            "sensor_patterns": self.sensors.buffer.counts.astype(np.float64),
            **watched,
        }

    def _watch(self, trial: int, innovations: np.ndarray) -> dict[str, np.ndarray]:
        """Look for damage, and forget what is contradicted, where that is asked for."""
        watch, row = self.config.watch, {}
        if watch.detect:
            onsets = self.adaptations.onsets
            row.update(self.detector.figures(trial, innovations, onsets))
        if watch.forget:
            gone = [
                sum(part.forget(run, watch) for part in (self.motion, self.sensors))
                for run in range(self.runs)
            ]
            row["forgotten"] = np.array(gone, np.float64)
        return row

    def _views(self, light: patterns.Patterns) -> patterns.Patterns:
        """Sensor patterns with the inputs that the SNNs take."""
        ahead, left = torch.from_numpy(light.inputs.T)
        views = self.simulator.views(ahead, left).T.numpy()
        return light._replace(inputs=views)

    def _keep(
        self, run: int, trial: int, moved: patterns.Patterns, light: patterns.Patterns
    ) -> None:
        self.motion.append(run, trial, moved)
        self.sensors.append(run, trial, self._views(light))

    def state(self) -> dict[str, np.ndarray]:
        """All that the next trial depends on, as arrays."""
        return {
            "genes": self.population.genes.cpu().numpy(),
            "draws": self.draws.state(),
            "onsets": self.adaptations.onsets,
            "innovations": self.detector.past,
            **self.motion.state("motion"),
            **self.sensors.state("sensors"),
        }

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        genes = torch.from_numpy(arrays["genes"]).to(self.config.device)
        self.population = self.population._replace(genes=genes)
        self.draws.restore(arrays["draws"])
        self.adaptations.onsets = arrays["onsets"].copy()
        self.detector.past = arrays["innovations"].copy()
        self.motion.restore("motion", arrays)
        self.sensors.restore("sensors", arrays)
