"""Which controller is tried in the world, and which one is deployed.

`choose` says which is tried (thesis 2.8 step 1, 5.3.9). Deployed is what a user would
run if trials ended now: the best controller seen to work.

BNS tries in each trial what evolution likes then, and nothing holds on to what worked.
Here each run keeps the controllers that did best since its robot last changed. The one
deployed has the lowest cost that can be counted on: the mean of its trials and, of what
a repeated controller is seen to differ from itself, as much as its number of trials
leaves in doubt.

Nobody tells of a change. It shows where a controller that is tried again does much
worse than it did, or where the learner forgets by evidence; what was seen before is
dropped then. A controller is tried again in doubt: where a trial went much worse than
the networks foresaw, where the deployed one was not seen for `AGE` trials or, where
trials differ by chance, only once, or where another may be better. Between two such
trials lie `PAUSE` others, so that learning goes on.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from bns.draws import Draws
from bns.errors import UnknownNameError
from bns.evolution import selection
from bns.experiment.config import RunConfig
from bns.experiment.validate import check_choice

KEPT = 12
"""controllers that a run keeps; assumed"""
AGE = 10
"""trials after which the deployed one is tried again; assumed"""
PAUSE = 3
"""trials between two in which a controller is tried again; assumed"""
OFTEN = 5
"""trials of a controller after which it is no longer in doubt; assumed"""
SURPRISE = 4.0
"""a miss so many times the usual is a surprise; assumed"""
WORSE = 0.1
"""share of its cost by which a controller that is tried again may differ, beside four
standard deviations; assumed"""


@dataclass
class Seen:
    """A controller and what it cost.

    Attributes:
        genes: of an individual, ``(K, G)``.
        length: commands of its list.
        costs: of its trials since the robot changed, in order; lower is better.
        last: number of the last of them.
    """

    genes: np.ndarray
    length: int
    costs: list[float]
    last: int

    @property
    def mean(self) -> float:
        """Cost of its trials."""
        return float(np.mean(self.costs))

    def bound(self, noise: float) -> float:
        """Cost that can be counted on.

        Args:
            noise: standard deviation of a controller's trials.
        """
        return self.mean + noise / float(np.sqrt(len(self.costs)))


@dataclass
class Deployed:
    """What one run keeps.

    Attributes:
        repeatable: whether the same controller does the same again, so that one that
            does much worse tells of a change.
        seen: controllers, best first.
        misses: how far the networks' foresight of the last trials was off, newest last.
        surprised: whether the last trial went much worse than was foreseen.
        again: trial in which a controller was last tried again; -1 = none.
        changed: trials at which a change was seen.
    """

    repeatable: bool
    seen: list[Seen] = field(default_factory=list)
    misses: list[float] = field(default_factory=list)
    surprised: bool = False
    again: int = -1
    changed: int = -1

    @property
    def noise(self) -> float:
        """Standard deviation of the trials of one controller, pooled; 0 = unknown."""
        several = [item.costs for item in self.seen if len(item.costs) > 1]
        free = sum(len(costs) - 1 for costs in several)
        if not free:
            return 0.0
        return float(np.sqrt(sum(np.var(c) * len(c) for c in several) / free))

    @property
    def best(self) -> Seen | None:
        """The one deployed; None = nothing was seen since the robot changed."""
        noise = self.noise
        return min(self.seen, key=lambda item: item.bound(noise), default=None)

    def wanted(self, trial: int) -> Seen | None:
        """The controller that is to be tried again in a trial; None = a new one."""
        best = self.best
        if best is None or (self.again >= 0 and trial - self.again <= PAUSE):
            return None
        once = len(best.costs) == 1 and not self.repeatable
        if self.surprised or trial - best.last >= AGE or once:
            return best
        noise = self.noise
        rival = min(
            self.seen, key=lambda item: item.mean - noise / np.sqrt(len(item.costs))
        )
        return rival if rival is not best and len(rival.costs) < OFTEN else None

    def note(
        self, trial: int, genes: np.ndarray, length: int, cost: float, foreseen: float
    ) -> None:
        """Take note of a trial.

        Args:
            trial: its number.
            genes: of what was tried, ``(K, G)``.
            length: commands of its list.
            cost: in the world.
            foreseen: by the networks.
        """
        known = next(
            (item for item in self.seen if np.array_equal(item.genes, genes)), None
        )
        self._watch(cost - foreseen)
        if known is not None:
            self.again = trial
        if known is None:
            self.seen.append(Seen(genes.copy(), length, [cost], trial))
        elif self._contradicts(known, cost):
            self.seen = [Seen(known.genes, length, [cost], trial)]
            self.changed, self.misses, self.surprised = trial, [], False
        else:
            known.costs.append(cost)
            known.last, self.surprised = trial, False
        noise = self.noise
        self.seen = sorted(self.seen, key=lambda item: item.bound(noise))[:KEPT]

    def _watch(self, miss: float) -> None:
        """Whether a trial's cost was above what was foreseen by more than usual."""
        usual = np.median(np.abs(self.misses)) if len(self.misses) >= 5 else np.inf
        self.surprised = bool(miss > SURPRISE * max(float(usual), 1e-9))
        self.misses = [*self.misses[-9:], miss]

    def _contradicts(self, known: Seen, cost: float) -> bool:
        """Whether a controller did so much worse that the robot is another one."""
        limit = WORSE * abs(known.mean) + 4 * self.noise
        return self.repeatable and cost > known.mean + limit

    def forget(self, before: int, trial: int) -> None:
        """Drop what was last seen before a trial.

        Args:
            before: that trial.
            trial: number of the newest one.
        """
        self.seen = [item for item in self.seen if item.last >= before]
        self.changed = trial


def packed(runs: Sequence[Deployed], shape: tuple[int, ...]) -> dict[str, np.ndarray]:
    """What R runs keep as plain arrays, one run after another.

    Args:
        runs: what each keeps.
        shape: of an individual's genes.

    Returns:
        name -> array, as `unpack` takes it.
    """
    seen = [item for run in runs for item in run.seen]
    genes = np.empty((len(seen), *shape), np.float32)
    for row, item in zip(genes, seen, strict=True):
        row[:] = item.genes
    flags = [[run.surprised, run.again, run.changed] for run in runs]
    return {
        "deployed.runs": np.array([len(run.seen) for run in runs], np.int64),
        "deployed.genes": genes,
        "deployed.lengths": np.array([item.length for item in seen], np.int64),
        "deployed.last": np.array([item.last for item in seen], np.int64),
        "deployed.counts": np.array([len(item.costs) for item in seen], np.int64),
        "deployed.costs": np.array([c for item in seen for c in item.costs], float),
        "deployed.missed": np.array([len(run.misses) for run in runs], np.int64),
        "deployed.misses": np.array([m for run in runs for m in run.misses], float),
        "deployed.flags": np.array(flags, np.int64),
    }


def unpack(runs: Sequence[Deployed], arrays: Mapping[str, np.ndarray]) -> None:
    """Put what `packed` gave back into R runs."""
    held = {name.partition(".")[2]: value for name, value in arrays.items()}
    costs = np.split(held["costs"], np.cumsum(held["counts"]))
    rows = zip(held["genes"], held["lengths"], costs, held["last"], strict=False)
    seen = [Seen(g, int(length), c.tolist(), int(last)) for g, length, c, last in rows]
    ends = np.cumsum(held["runs"])
    misses = np.split(held["misses"], np.cumsum(held["missed"]))
    for number, run in enumerate(runs):
        run.seen = seen[ends[number] - held["runs"][number] : ends[number]]
        run.misses = misses[number].tolist()
        surprised, run.again, run.changed = held["flags"][number].tolist()
        run.surprised = bool(surprised)


def choose(
    config: RunConfig,
    trial: int,
    cost: Tensor,
    draws: Draws,
    disagreement: Callable[[], Tensor],
) -> Tensor:
    """Index of one controller a run, ``(R,)``.

    tournament: the best of a random share `choose_tournament` of the population;
    best: the lowest predicted cost; random: any; best-worst-random: the three in turn,
    trial by trial (Parker 2000); disagreement: the one on which the ensemble's members
    differ most, among the better half (Bongard 2006 picks tests this way).

    Args:
        config: says how.
        trial: its number.
        cost: predicted, ``(R, P)``.
        draws: source of randomness.
        disagreement: gives how far an ensemble disagrees on each, ``(R, P)``.

    Raises:
        BnsError: disagreement without an ensemble.
        UnknownNameError: no such rule.
    """
    kind: str = config.choose
    if kind == "best-worst-random":
        kind = ("best", "worst", "random")[trial % 3]
    if kind == "best":
        return cost.argmin(1)
    if kind == "worst":
        return cost.argmax(1)
    if kind == "random":
        return selection.random(cost, draws.uniform(len(cost), 1, 1)).squeeze(1)
    if kind == "tournament":
        size = max(1, round(config.choose_tournament * cost.shape[1]))
        coins = draws.uniform(len(cost), 1, size)
        return selection.tournament(cost, coins).squeeze(1)
    if kind == "disagreement":
        check_choice(config)
        spread = disagreement()
        good = cost <= cost.median(1, keepdim=True).values
        return torch.where(good, spread, -1.0).argmax(1)
    known = ("best", "tournament", "random", "best-worst-random", "disagreement")
    raise UnknownNameError("choice", config.choose, known)
