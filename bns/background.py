"""Open-loop navigation on a real robot: evolution goes on while the robot moves."""

import contextlib
import os
import sys
import threading
from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np
import torch

from bns.config import RunConfig
from bns.errors import BnsError
from bns.evolution.generation import Rates
from bns.learner import Learner, Proposal
from bns.worlds import alarm
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial

CHUNK = 5  # generations between two looks whether the trial is over
LEAST = 20  # generations in a trial, even where it takes no time
LONGEST = 2000  # generations in a trial: beyond, the population has long converged
SWITCH = 0.001  # s after which Python lets the robot's thread have its turn


class Background:
    """A `Learner` whose generations run in a thread between proposal and observation.

    How many there are is what the robot's time allows, and is recorded; so results
    are not reproducible bit for bit. Where the thread fails it rings the alarm, which
    stops the robot, and `observe` raises.

    Args:
        configs, replicates, onsets: see `Learner`.
    """

    def __init__(
        self,
        configs: Sequence[RunConfig],
        *,
        replicates: Sequence[int],
        onsets: Sequence[int],
    ):
        still = [
            replace(config, evolution=replace(config.evolution, generations=0))
            for config in configs
        ]
        self.learner = Learner(still, replicates=replicates, onsets=onsets)
        self._inner = copy(self.learner.inner)
        chunk = replace(configs[0].evolution, generations=CHUNK)
        self._inner.config = replace(configs[0], evolution=chunk)
        self._first = configs[0].evolve_from
        self._thread: threading.Thread | None = None
        self._over = threading.Event()
        self._failed = False
        self.generations = 0

    def propose(self, trial: int) -> Proposal:
        """What to try; from now on evolution goes on until `observe`."""
        proposal = self.learner.propose(trial)
        self.generations, self._failed = 0, False
        self._over.clear()
        sys.setswitchinterval(SWITCH)
        self._thread = threading.Thread(
            target=self._evolve, args=(trial,), name="evolution", daemon=True
        )
        self._thread.start()
        return proposal

    def _evolve(self, trial: int) -> None:
        with contextlib.suppress(OSError, AttributeError):
            # the robot's thread has precedence, this one has not
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 0)
        whole = False
        try:
            while self.generations < LONGEST and not self._enough():
                self._breed(trial)
            whole = True
        finally:
            if not whole:
                self._failed = True
                alarm.ring("the learner failed, see its message")

    def _enough(self) -> bool:
        return self._over.is_set() and self.generations >= LEAST

    def _breed(self, trial: int) -> None:
        """A few generations."""
        learner = self.learner
        if trial + 1 < self._first:
            self.generations = LONGEST
            return
        learner.population, learner.cost = self._inner.evolve(
            learner.theta, learner.population, learner.cost, self._rates(trial)
        )
        self.generations += CHUNK

    def _rates(self, trial: int) -> Rates:
        rate, magnitude = self.learner.adaptations.mutation(trial)
        return Rates(torch.from_numpy(rate), torch.from_numpy(magnitude))

    def _join(self) -> None:
        if self._thread is not None:
            self._over.set()
            self._thread.join()
            self._thread = None
        if self._failed:
            raise BnsError("The learner failed in the background: see its message.")

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """Learn from the trial, see `Learner.observe`; adds "generations".

        Raises:
            BnsError: the thread failed; its message is on the error stream.
        """
        self._join()
        row = self.learner.observe(trial, tried, best)
        if trial + 1 < self._first:
            self.generations = 0
        row["generations"] = np.full(self.learner.runs, float(self.generations))
        return row

    def state(self) -> dict[str, np.ndarray]:
        """All that the next trial depends on, see `Learner.state`."""
        self._join()
        return self.learner.state()

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        self.learner.restore(arrays)


def behind(config: RunConfig) -> Background:
    """The learner of all replicates of a configuration.

    Raises:
        BnsError: it is not one for navigation.
    """
    if config.learner != "navigation":
        raise BnsError(
            f"Learner {config.learner!r} cannot go on in the background; 'navigation' "
            "can."
        )
    runs = config.replicates
    onset = Damage.parse(config.world.damage).first_trial
    return Background([config] * runs, replicates=[*range(runs)], onsets=[onset] * runs)
