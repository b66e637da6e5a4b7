"""Learning beside a robot that moves: the learner is in a process of its own.

A process and not a thread, so that the robot's loop never waits for the learner: it may
be slow, hang or fail, and the robot is stopped in time.
"""

import threading
from collections.abc import Mapping, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.learners.base import Learner, Proposal
from bns.tasks import registry as tasks
from bns.worlds import world
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial


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
            world.ring("the learner failed, see its message")

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
