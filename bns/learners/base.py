"""What a learner is: it says what to try, is told what came of it, and keeps its state.

A module of `bns.learners` (or a package with a module `learner`) has one subclass of
`Learner`, `LEARNER`, and its first line says what it is. That is all that a new learner
needs: batches, resume, campaigns, statistics, reports and hardware work with it.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from bns.errors import BnsError
from bns.experiment.config import LearnerSettings, RunConfig
from bns.learners import contract
from bns.tasks import registry as tasks
from bns.tasks.base import Task
from bns.worlds.trial import Trial
from bns.worlds.world import CountedWorld

Controller = TypeVar("Controller")  # what the task's `Space` decodes

PER_RUN = ("preset", "adaptation", "world")
"""settings in which the runs of any batch may differ"""


@dataclass(frozen=True)
class Proposal(Generic[Controller]):
    """What to run in the world.

    Attributes:
        tried: the controller each run learns from, R of them.
        best: what each run would drive with if trials ended now, where that is another
            one: to be measured, not learned from and not charged; else None.
    """

    tried: list[Controller]
    best: list[Controller] | None = None


@dataclass(frozen=True)
class Panel:
    """A column of the record over trials: its title, and the factor to its unit."""

    column: str
    title: str
    factor: float = 1.0


@dataclass(frozen=True)
class Curves:
    """A figure of a learner's own columns over trials, a panel each.

    Attributes:
        name: of the figure in a report.
        title, caption: of the figure; "{band}" in it explains line and band.
        label: of the vertical axis.
        panels: what is drawn.
        log: whether the axis is logarithmic.
        shared: whether the panels share it.
        compared: whether it is drawn where several batches are compared, too.
    """

    name: str
    title: str
    caption: str
    label: str
    panels: tuple[Panel, ...]
    log: bool = False
    shared: bool = False
    compared: bool = True


class Learner(ABC):
    """R runs of a way to learn, advancing trial by trial in lockstep.

    Args:
        configs: one per run; they may differ in `PER_RUN` alone.
        replicates: number of each run, part of its identity.
        onsets: first damaged trial of each run, -1 = none: for adaptations that are
            *told* when damage came, and for nothing else.
        models: a world to think in for each run, its evaluations counted and limited;
            none where `prior.world` is empty.

    Raises:
        BnsError: configurations that cannot share a batch, a setting that the learner
            or the task cannot be with, or no model where one is needed.
    """

    Settings: ClassVar[type[LearnerSettings]] = LearnerSettings
    """the section `settings` of its configurations"""
    sections: ClassVar[tuple[str, ...]] = ()
    """other sections and settings of a configuration that are its own"""
    columns: ClassVar[Mapping[str, str]] = {}
    """per-trial figures that `observe` gives for every task, with their meaning"""
    open_columns: ClassVar[bool] = False
    """whether it gives others beside, as task and settings have it"""
    figures: ClassVar[tuple[Curves | str, ...]] = ()
    """what a report shows of it: own columns, or figures of `bns.viz.figures`"""

    needs_model: ClassVar[bool] = False
    """whether it is nothing without a model world (`prior.world`)"""
    open_loop: ClassVar[bool] = False
    """whether it knows lists of commands alone, and no controllers that steer"""
    kinds: ClassVar[tuple[str, ...]] = ()
    """the kinds of task that it knows; none = all"""

    deploys: bool = False
    """whether `Proposal.best` is what a user would run, and its figures are recorded
    apart from those of what is tried: the column `solved_best`"""

    def __init_subclass__(cls, **named: Any) -> None:
        super().__init_subclass__(**named)
        contract.hold(cls)

    def __init__(
        self,
        configs: Sequence[RunConfig],
        *,
        replicates: Sequence[int],
        onsets: Sequence[int],
        models: Sequence[CountedWorld] = (),
    ):
        self.config, self.configs, self.runs = configs[0], list(configs), len(configs)
        self.replicates, self.models = list(replicates), list(models)
        self.onsets = list(onsets)
        self.task: Task = tasks.of(configs[0])
        self._check_known()
        self.check_alike(configs)
        self.begin()

    def _check_known(self) -> None:
        """Refuse a task or a prior with which it is nothing."""
        name = f"The learner {self.config.learner!r}"
        kind = tasks.kind(self.config.task.name)
        if self.kinds and kind not in self.kinds:
            raise BnsError(
                f"{name} knows tasks of the kind {', '.join(self.kinds)} alone, and "
                f"{self.config.task.name!r} is of the kind {kind}: take another "
                "learner."
            )
        if self.open_loop and self.task.closed_loop:
            raise BnsError(
                f"{name} knows lists of commands; in the task "
                f"{self.config.task.name!r} robots steer: take another learner."
            )
        if self.needs_model and not self.models:
            raise BnsError(
                f"{name} thinks in a model of the robot: give --prior.world mujoco, "
                "light, hexapod or static-snn."
            )

    def begin(self) -> None:  # noqa: B027 (nothing to do is the default)
        """Make what the first trial needs, once configurations and task are known."""

    def check_alike(self, configs: Sequence[RunConfig]) -> None:
        """Refuse configurations that cannot share a batch.

        Raises:
            BnsError: they differ in more than `PER_RUN`.
        """
        first = configs[0]
        free: dict[str, Any] = {name: getattr(first, name) for name in PER_RUN}
        if any(replace(config, **free) != first for config in configs):
            raise BnsError(
                "Runs of one batch may differ in `adaptation` and `world` only; "
                "train the others as a batch of their own."
            )

    @classmethod
    def figures_of(cls, task: Task) -> list[Curves | str]:
        """What a report shows of runs of a task; see `figures`."""
        del task
        return list(cls.figures)

    @classmethod
    def compiles(cls, config: RunConfig) -> bool:
        """Whether a run is compiled; the record says so."""
        del config
        return False

    @abstractmethod
    def propose(self, trial: int) -> Proposal[Any]:
        """What to try in trial number `trial`, as the task's controllers."""

    @abstractmethod
    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """Learn from a trial of every run.

        Args:
            trial: its number.
            tried: R trials of the proposed controllers, without the damage and the
                truth.
            best: R trials of `Proposal.best` where there was one.

        Returns:
            `columns`, each ``(R,)``, and arrays with the run first; "predicted"
            ``(R, K + 1, 3)`` are the poses it had foreseen. A column that is missing or
            not declared is a `BnsError` (`bns.learners.contract`).
        """

    @abstractmethod
    def state(self) -> dict[str, np.ndarray]:
        """All that the next trial depends on, as plain arrays.

        Returns:
            name -> array, each as `restore` takes it.
        """

    @abstractmethod
    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from `state`."""

    def spent(self) -> dict[str, np.ndarray]:
        """What models have spent, a part of `state`: "spent" ``(R,)``; none without."""
        return {"spent": np.array([model.spent for model in self.models], np.int64)}

    def restore_spent(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from `spent`."""
        for model, spent in zip(self.models, arrays["spent"], strict=True):
            model.spent = int(spent)

    def run_in_background(self) -> None:  # noqa: B027 (nothing to do is the default)
        """From now on think in `think`, while trials run, and not in `propose`."""

    def think(self) -> bool:
        """A short piece of thinking while a trial runs; False: there is none left."""
        return False


class RememberingLearner(Learner):
    """A learner that keeps what it knows of each run in one object of plain arrays.

    Attributes:
        memories: R objects, all of whose attributes are arrays.
    """

    memories: Sequence[Any]

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`: all that each run knows, and what models have spent."""
        found = self.spent()
        for run, memory in enumerate(self.memories):
            found |= {f"{run}.{name}": array for name, array in vars(memory).items()}
        return found

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        for run, memory in enumerate(self.memories):
            for name in vars(memory):
                setattr(memory, name, arrays[f"{run}.{name}"].copy())
        self.restore_spent(arrays)
