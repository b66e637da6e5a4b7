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
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import ClassVar, cast

from torch import Tensor

from bns.evolution.icem import Icem
from bns.experiment.config import LearnerSettings, RunConfig
from bns.learners.bns.config import BNS_SECTIONS
from bns.learners.bns.learner import Bns
from bns.learners.bns.navigation import Evaluator, OpenLoopProblem
from bns.snn.network import forward
from bns.worlds.world import CountedWorld


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
