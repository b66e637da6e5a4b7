"""The walking learner's inner loops: as `bns.inner`, but for the training.

No generation is compiled here. A compiled one took 4.5 times as long as an eager one
(30 runs of 400 lists of 198 goals, one thread: 0.38 s against 0.085 s), since the
compiler has no vectorised inverse error function, which normal mutations need; what the
networks foresee is a matter of large matrix products, which are as fast without.
"""

from functools import partial

from torch import Tensor

from bns.draws import Draws
from bns.evolution.generation import Breeder
from bns.experiment.config import RunConfig
from bns.inner import InnerLoops
from bns.snn.fitting import Patterns
from bns.walk import training
from bns.walk.evaluation import WalkEvaluator


class WalkLoops(InnerLoops):
    """Evolution and training of R walking runs; arguments as `InnerLoops`."""

    def __init__(
        self,
        config: RunConfig,
        evaluator: WalkEvaluator,
        breeder: Breeder,
        draws: Draws,
    ):
        super().__init__(config, evaluator, breeder, draws)
        self._breed, self._judge = self._bred, partial(evaluator.judge)

    def train(
        self,
        theta: Tensor,
        inputs: Tensor,
        targets: Tensor,
        weight: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Train the ensembles, see `InnerLoops.train`."""
        config = self.config
        if config.walk.batch == 0:
            return super().train(theta, inputs, targets, weight)
        return training.fit(
            self.evaluator.shape,
            config,
            theta,
            Patterns(inputs, targets, weight),
            self.draws,
        )
