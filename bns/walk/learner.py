"""BNS with walking robots: evolve servo goals inside an ensemble, walk, train, repeat.

The loop, its resets and its state are those of `bns.learner.Learner`; what differs is
what genes mean, what the networks foresee and what a trial is worth.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from bns import seeding
from bns.adaptation import Adaptations
from bns.draws import Draws
from bns.errors import BnsError
from bns.evolution.generation import Rates
from bns.experiment.config import RunConfig
from bns.learner import Learner, check_alike
from bns.patterns import PatternBuffer
from bns.snn.network import Shape
from bns.snn.scaling import OUTPUTS
from bns.walk import forgetting, observing, scaling
from bns.walk.evaluation import WalkEvaluator
from bns.walk.goals import TICK, GoalBreeder, Goals
from bns.walk.loops import WalkLoops
from bns.worlds.trial import Trial

BUCKET = 256  # patterns; training tensors grow in these steps


class WalkLearner(Learner):
    """R runs of BNS with walking robots as one tensor program.

    Args:
        configs: one per run; they may differ in `adaptation`, `seed` and world, all
            else must agree.
        replicates: number of each run, part of its identity.
        onsets: first damaged trial of each run, -1 = none.

    Raises:
        BnsError: configurations that cannot share a batch, an SNN that is no ensemble,
            a robot that cannot walk.
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
        if config.snn.kind != "ensemble":
            raise BnsError(
                "learner = 'walk' weighs how far networks disagree; set "
                "snn.kind = 'ensemble' (the preset hexapod-walk does)."
            )
        torch.set_num_threads(config.threads)
        self.config, self.configs, self.runs = config, list(configs), len(configs)
        self.draws = Draws(
            seeding.integer(config.seed, "walk-learner", *replicates), config.device
        )
        self.encoding = Goals.of(config)
        servos = len(self.encoding.channels)
        self.shape = Shape(
            groups=config.snn.members,
            hidden=config.snn.hidden,
            outputs=OUTPUTS,
            inputs=2 * servos,
            activation=config.walk.activation,
        )
        self.scaling = scaling.Scaling()
        self.evaluator = WalkEvaluator(self.shape, config.walk)
        breeder = GoalBreeder(config.evolution, self.encoding, True)
        self.inner = WalkLoops(config, self.evaluator, breeder, self.draws)
        self.adaptations = Adaptations(configs, onsets)
        self.buffer = PatternBuffer(
            self.runs, self.adaptations.windows, (2 * servos, OUTPUTS), BUCKET
        )
        self.population = self._random_population()
        self.theta = self.shape.random(self.runs, self.draws)
        self.loss = torch.full((self.runs,), torch.nan)
        self.cost: Tensor | None = None
        self._chosen = self.population.pick(torch.zeros(self.runs, dtype=torch.long))

    def _choosing(self, trial: int) -> RunConfig:
        """Before evolution starts, any: an SNN that has seen next to nothing would
        choose what it has seen."""
        if trial < self.config.evolve_from:
            return replace(self.config, choose="random")
        return self.config

    def _rates(self, trial: int) -> Rates:
        rate, _ = self.adaptations.mutation(trial)
        usual = [config.walk.mutation_magnitude for config in self.configs]
        size = self.adaptations.magnitudes(trial, usual)
        each = torch.tensor(size, dtype=torch.float32)[:, None] * TICK
        device, servos = self.config.device, len(self.encoding.channels)
        return Rates(
            torch.from_numpy(rate).to(device),
            each.expand(-1, servos).to(device),
            repeat=self._repeat(trial),
        )

    def _repeat(self, trial: int) -> Tensor | None:
        """Chance that a child repeats its commands, of each run; None = of no run."""
        walk = self.config.walk
        chance = self.adaptations.since_damage(trial, walk.repeat, walk.repeat_after)
        if not chance.any():
            return None
        return torch.from_numpy(chance.astype(np.float32)).to(self.config.device)

    def _measured(
        self, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        row = observing.measured(tried, best, self.config.walk)
        poses = self.evaluator.poses(self.theta, self._chosen)[:, 0]
        row["predicted"] = poses.double().cpu().numpy()
        row["distance_predicted"] = observing.distance(row["predicted"])
        doubt = self.evaluator.disagreement(self.theta, self._chosen)[:, 0]
        row["disagreement"] = doubt.double().cpu().numpy()
        cost = self.evaluator.cost(self.theta, self._chosen)[:, 0]
        row["worth_predicted"] = cost.double().cpu().numpy()
        return row

    def _predicted_cost(self) -> np.ndarray:
        poses = self.evaluator.poses(self.theta, self._chosen)[:, 0]
        return observing.cost(observing.distance(poses.double().cpu().numpy()))

    def _train(self, which: Tensor) -> None:
        """Train, once what is of another robot than now has been forgotten."""
        if self.config.watch.forget:
            for run in range(self.runs):
                seen, told = self.buffer.inputs[run], self.buffer.targets[run]
                newest = forgetting.changed(seen, told, self.config.walk.commands)
                if newest:
                    self.buffer.keep(run, newest)
        super()._train(which)

    def _patterns(self, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
        return scaling.of_trial(trial)
