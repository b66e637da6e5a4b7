"""Configurations and their replicates as one batch: a learner and its worlds.

A learner may be in a process of its own, beside a robot that moves (`Background`). A
process and not a thread, so that the robot's loop never waits for the learner: it may
be slow, hang or fail, and the robot is stopped in time.
"""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from bns import seeding
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.experiment.record import Step
from bns.learners import registry as learners
from bns.learners.base import Learner, Proposal
from bns.tasks import registry as tasks
from bns.tasks.base import Task
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial
from bns.worlds.world import CountedWorld, World, ring

ALGEBRA = "libscipy_openblas"
"""prefix of the linear algebra that comes with NumPy and SciPy. Left alone it takes a
thread a core for matrices that one has done sooner, and batches that run side by side
on many cores then mostly wait for each other; what it gives would depend on the cores.
"""


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
        self._algebra = _algebra()

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
        """One trial of every run: propose, execute, learn; see `ALGEBRA`.

        Args:
            trial: its number, counted from 0.
            recorded: replicates of the first configuration whose samples are kept.

        Returns:
            What happened, and the trial of every run.
        """
        with self._algebra.limit(limits=1):
            return self._advance(trial, recorded)

    def _advance(self, trial: int, recorded: int) -> tuple[Step, list[Trial]]:
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


def _algebra() -> ThreadpoolController:
    """What limits the threads of NumPy's linear algebra, see `ALGEBRA`."""
    return ThreadpoolController().select(prefix=ALGEBRA)


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


class Background(Learner):
    """A learner that thinks between proposal and observation (`Learner.think`).

    How much is what the robot's time allows, so results are not reproducible bit for
    bit. Where its process fails it rings the alarm, which stops the robot.

    Args:
        configs, replicates, onsets: see `Learner`; models are made in the process.

    Raises:
        BnsError: the learner fails to start.

    Attributes:
        deploys: as of the learner in the process.
    """

    def __init__(
        self,
        configs: Sequence[RunConfig],
        *,
        replicates: Sequence[int],
        onsets: Sequence[int],
    ):
        super().__init__(configs, replicates=replicates, onsets=onsets)
        spawn = get_context("spawn")
        self._line, other = spawn.Pipe()
        words = (other, list(configs), list(replicates), list(onsets))
        self._process = spawn.Process(target=_serve, args=words, daemon=True)
        self._process.start()
        other.close()
        self.deploys = self._hear()
        threading.Thread(target=self._watch, daemon=True).start()

    def check_alike(self, configs: Sequence[RunConfig]) -> None:
        """The process does."""

    def _watch(self) -> None:
        """Ring the alarm when the process is gone."""
        wait([self._process.sentinel])
        if self._process.exitcode:
            ring("the learner failed, see its message")

    def propose(self, trial: int) -> Proposal[Any]:
        """What to try; from now on the learner thinks until `observe`."""
        proposal: Proposal[Any] = self._ask("propose", trial)
        return proposal

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`."""
        row: dict[str, np.ndarray] = self._ask(
            "observe", trial, list(tried), best and list(best)
        )
        return row

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`."""
        arrays: dict[str, np.ndarray] = self._ask("state")
        return arrays

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        self._ask("restore", dict(arrays))

    def _ask(self, name: str, *words: Any) -> Any:
        try:
            self._line.send((name, words))
        except OSError as error:
            raise _failed() from error
        return self._hear()

    def _hear(self) -> Any:
        try:
            return self._line.recv()
        except (OSError, EOFError) as error:
            raise _failed() from error


def _failed() -> BnsError:
    return BnsError("The learner failed; its message is above.")


def _serve(
    line: Connection,
    configs: list[RunConfig],
    replicates: list[int],
    onsets: list[int],
) -> None:
    """The learner's process: answer what is asked, think in between."""
    import signal

    from bns.experiment.world_factory import make_models
    from bns.learners import registry as learners

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it ends with the robot's process
    _algebra().limit(limits=1)  # until the process ends; the robot's loop needs a core
    learner = learners.get(configs[0].learner)(
        configs,
        replicates=replicates,
        onsets=onsets,
        models=make_models(configs[0]),
    )
    learner.run_in_background()
    line.send(learner.deploys)
    busy = False
    while True:
        while busy and not line.poll():
            busy = learner.think()
        try:
            name, words = line.recv()
        except EOFError:
            return
        line.send(_answered(learner, name, words))
        busy = name == "propose"


def _answered(learner: Learner, name: str, words: tuple[Any, ...]) -> Any:
    """What the learner says; with a trial, the evaluations of its models, too."""
    answer = getattr(learner, name)(*words)
    if name == "observe" and learner.models:
        spent = [model.spent for model in learner.models]
        answer["evaluations"] = np.array(spent, np.float64)
    return answer


def behind(config: RunConfig) -> Background:
    """The learner of all replicates of a configuration.

    Raises:
        BnsError: a task that closes a loop with the robot.
    """
    if tasks.of(config).closed_loop:
        raise BnsError(
            f"The task {config.task.name!r} closes a loop with the robot and cannot "
            "be learned in the background; a task of lists of commands can."
        )
    runs = config.replicates
    onset = Damage.parse(config.world.damage).first_trial
    return Background([config] * runs, replicates=[*range(runs)], onsets=[onset] * runs)
