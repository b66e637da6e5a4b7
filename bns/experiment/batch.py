"""Configurations and their replicates as one batch: a learner and its worlds."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.experiment.step import Step
from bns.learners import registry as learners
from bns.learners.base import Learner
from bns.tasks import registry as tasks
from bns.tasks.base import Task
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial
from bns.worlds.world import CountedWorld, World


class Batch:
    """C configurations times R replicates, advancing trial by trial in lockstep.

    Run ``c * R + r`` is replicate r of configuration c.

    Args:
        configs: they may differ in `adaptation` and `world` only.
        worlds: one per configuration.
        learner: knows all C * R runs; None makes the one the configuration names.
        models: a model world for each of the C * R runs, where there is a prior.

    Raises:
        BnsError: configurations that cannot share a batch.
    """

    def __init__(
        self,
        configs: Sequence[RunConfig],
        worlds: Sequence[World],
        *,
        learner: Any = None,
        models: Sequence[CountedWorld] = (),
    ):
        self.configs, self.worlds = list(configs), list(worlds)
        self.replicates = configs[0].replicates
        self.damages = [Damage.parse(config.world.damage) for config in configs]
        self.task: Task = tasks.of(configs[0])
        self.learner: Learner = learner or self._make_learner(models)

    def _make_learner(self, models: Sequence[CountedWorld]) -> Learner:
        return learners.get(self.configs[0].learner)(
            [config for config in self.configs for _ in range(self.replicates)],
            replicates=[*range(self.replicates)] * len(self.configs),
            onsets=[
                d.first_trial for d in self.damages for _ in range(self.replicates)
            ],
            models=models,
        )

    def part(self, index: int) -> slice:
        """The runs of configuration `index`."""
        return slice(index * self.replicates, (index + 1) * self.replicates)

    def advance(self, trial: int, *, recorded: int = 0) -> tuple[Step, list[Trial]]:
        """One trial of every run: propose, execute, learn.

        Args:
            trial: its number, counted from 0.
            recorded: replicates of the first configuration whose samples are kept.

        Returns:
            What happened, and the trial of every run.
        """
        proposal = self.learner.propose(trial)
        tried = self._execute(proposal.tried, trial, "world")
        best = None
        if proposal.best is not None:
            best = self._execute(proposal.best, trial, "world-best")
        observed = self._measured(tried, best)
        blind = None if best is None else told(best)
        observed.update(self.learner.observe(trial, told(tried), blind))
        observed.setdefault("predicted", np.full_like(observed["poses"], np.nan))
        if models := self.learner.models:
            observed["evaluations"] = np.array([m.spent for m in models], np.float64)
        on = [float(damage.is_on(trial)) for damage in self.damages]
        observed["damaged"] = np.repeat(on, self.replicates)
        return Step.of(observed, tried[: min(recorded, self.replicates)]), tried

    def _measured(
        self, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """What the task says of the trials; fitness_best is that of `best`."""
        row = self.task.measured(tried)
        others = row["fitness"] if best is None else self.task.fitness(best)
        row["fitness_best"] = others
        if self.learner.deploys:
            deployed = row if best is None else self.task.measured(best)
            row["solved_best"] = deployed["solved"]
        return row

    def _execute(self, tried: Sequence[Any], trial: int, stream: str) -> list[Trial]:
        trials: list[Trial] = []
        for index, (config, world) in enumerate(
            zip(self.configs, self.worlds, strict=True)
        ):
            seeds = [
                seeding.integer(config.seed, stream, replicate, trial)
                for replicate in range(self.replicates)
            ]
            part = tried[self.part(index)]
            trials += self.task.execute(world, part, trial=trial, seeds=seeds)
        return trials


def told(trials: Sequence[Trial]) -> list[Trial]:
    """Trials as a learner may see them: without the damage and the truth."""
    return [trial.replace(conditions={}, truth={}) for trial in trials]


def resolve(config: RunConfig, mode: str = "") -> tuple[RunConfig, str]:
    """The configuration the learner gets, "compiled" or "eager" settled.

    Args:
        config: what was asked for.
        mode: what a run that is resumed used; empty settles it now.

    Raises:
        MissingDependencyError: compiled code is wanted without a compiler.
    """
    if not mode:
        compiles = learners.get(config.learner).compiles(config)
        mode = "compiled" if compiles else "eager"
    return replace(config, compiled="yes" if mode == "compiled" else "no"), mode


def check_device(name: str) -> None:
    """Refuse a torch device that is not there.

    Raises:
        BnsError: no such device here.
    """
    if name == "cpu":
        return
    import torch

    try:
        torch.empty(0, device=name)
    except (RuntimeError, AssertionError, NotImplementedError):
        raise BnsError(
            f"device = {name!r} is not available here: give cpu, or install a torch "
            "for that device (see `bns doctor` for the one that is installed)."
        ) from None


def check_world(config: RunConfig, *, named: bool = True) -> None:
    """Refuse a learner, task, world, robot, damage or reality that does not exist, and
    speeds that the robot does not take.

    Args:
        config: says which.
        named: whether world and robot are found by their names.

    Raises:
        UnknownNameError: no such name.
        BnsError: a text that cannot be read, a value out of bounds.
    """
    learners.get(config.learner)
    tasks.kind(config.task.name)
    if named:
        from bns.experiment import robots
        from bns.worlds import registry

        registry.get(config.world.name)
        robots.check_speeds(config)
    Damage.parse(config.world.damage)
    Damage.parse(config.world.reality)
