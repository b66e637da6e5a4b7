"""Learning beside a robot that moves: evolution goes on in a process of its own.

A process and not a thread, so that the robot's loop never waits for the learner: it may
be slow, hang or fail, and the robot is stopped in time.
"""

import threading
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.worlds import alarm
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial

OPEN_LOOP = ("navigation", "walk")
"""learners that can: what they try is known before it is tried"""

CHUNK = 5  # generations between two looks whether the trial is over
LEAST = 20  # generations after a trial, with what was learned from it


class Background:
    """A learner whose generations run between proposal and observation.

    How many there are is what the robot's time allows, at most those that the
    configuration says and `LEAST` after the trial, and is recorded ("generations"); so
    results are not reproducible bit for bit. (Without a limit a trial has time for two
    thousand: they find what the SNN gets wrong, and a hexapod walks half as far.) Where
    its process fails it rings the alarm, which stops the robot.

    Args:
        configs, replicates, onsets: see `bns.learner.Learner`.
    """

    def __init__(
        self,
        configs: Sequence[RunConfig],
        *,
        replicates: Sequence[int],
        onsets: Sequence[int],
    ):
        spawn = get_context("spawn")
        self._line, other = spawn.Pipe()
        words = (other, list(configs), list(replicates), list(onsets))
        self._process = spawn.Process(target=_serve, args=words, daemon=True)
        self._process.start()
        other.close()
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        """Ring the alarm when the process is gone."""
        wait([self._process.sentinel])
        if self._process.exitcode:
            alarm.ring("the learner failed, see its message")

    def propose(self, trial: int) -> Any:
        """What to try; from now on evolution goes on until `observe`."""
        return self._ask("propose", trial)

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """Learn from the trial, see `Learner.observe`; adds "generations"."""
        return self._ask("observe", trial, list(tried), best and list(best))

    def state(self) -> dict[str, np.ndarray]:
        """All that the next trial depends on, see `Learner.state`."""
        return self._ask("state")

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        self._ask("restore", arrays)

    def _ask(self, name: str, *words: Any) -> Any:
        try:
            self._line.send((name, words))
            return self._line.recv()
        except (OSError, EOFError) as error:
            raise BnsError("The learner failed; its message is above.") from error


def _serve(
    line: Connection,
    configs: list[RunConfig],
    replicates: list[int],
    onsets: list[int],
) -> None:
    """The learner's process: answer what is asked, evolve in between."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it ends with the robot's process
    worker = Worker(configs, replicates=replicates, onsets=onsets)
    while True:
        while worker.busy and not line.poll():
            worker.breed()
        try:
            name, words = line.recv()
        except EOFError:
            return
        line.send(getattr(worker, name)(*words))


class Worker:
    """The learner itself, with its generations taken out and counted.

    Args:
        configs, replicates, onsets: see `bns.learner.Learner`.

    Attributes:
        busy: whether there is something to evolve now.
        generations: since the newest proposal.
    """

    def __init__(
        self,
        configs: Sequence[RunConfig],
        *,
        replicates: Sequence[int],
        onsets: Sequence[int],
    ):
        from bns.learners import registry as learners

        still = [
            replace(config, evolution=replace(config.evolution, generations=0))
            for config in configs
        ]
        kind = learners.get(configs[0].learner)
        self.learner = kind.make(still, replicates=replicates, onsets=onsets)
        self._inner = copy(self.learner.inner)
        chunk = replace(configs[0].evolution, generations=CHUNK)
        self._inner.config = replace(configs[0], evolution=chunk)
        self._first = configs[0].evolve_from
        self._longest = configs[0].evolution.generations
        self._trial, self.generations, self.busy = 0, 0, False

    def breed(self) -> None:
        """A few generations."""
        learner = self.learner
        learner.population, learner.cost = self._inner.evolve(
            learner.theta,
            learner.population,
            learner.cost,
            learner._rates(self._trial),
        )
        self.generations += CHUNK
        self.busy = self.generations < self._longest

    def propose(self, trial: int) -> Any:
        """What to try."""
        proposal = self.learner.propose(trial)
        self._trial, self.generations = trial, 0
        self.busy = trial + 1 >= self._first
        return proposal

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """Learn, and breed on with what was learned."""
        evolving, during = self.busy or self.generations > 0, self.generations
        self.busy = False
        row = self.learner.observe(trial, tried, best)
        self.learner.cost = self.learner.inner.cost(
            self.learner.theta, self.learner.population
        )
        while evolving and self.generations < during + LEAST:
            self.breed()
        self.busy = False
        row["generations"] = np.full(self.learner.runs, float(self.generations))
        return row

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`."""
        return self.learner.state()

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        self.learner.restore(arrays)


def behind(config: RunConfig) -> Background:
    """The learner of all replicates of a configuration.

    Raises:
        BnsError: a learner that closes a loop with the robot.
    """
    if config.learner not in OPEN_LOOP:
        raise BnsError(
            f"Learner {config.learner!r} cannot go on in the background; "
            f"{' and '.join(map(repr, OPEN_LOOP))} can."
        )
    runs = config.replicates
    onset = Damage.parse(config.world.damage).first_trial
    return Background([config] * runs, replicates=[*range(runs)], onsets=[onset] * runs)
