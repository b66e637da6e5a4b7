"""What a task is: start, controllers, how a trial of one runs, score, what is shown."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.worlds.trial import Trial

if TYPE_CHECKING:
    from bns.experiment.record import RunRecord
    from bns.learners.bns.problem import Problem

Arrays = dict[str, np.ndarray]

BOARD = (1.35, 0.9)
"""m; half the arena's board (thesis 4.2.1)"""


@dataclass(frozen=True, eq=False)
class Space:
    """All controllers of a task as vectors of D real numbers.

    Attributes:
        low, high: bounds, ``(D,)``.
        first_low, first_high: random controllers lie between these, ``(D,)``.
        decode: controllers from vectors ``(N, D)`` within the bounds, N of them.
    """

    low: np.ndarray
    high: np.ndarray
    first_low: np.ndarray
    first_high: np.ndarray
    decode: Callable[[np.ndarray], list[Any]]

    @property
    def size(self) -> int:
        """Numbers that a controller is, D."""
        return len(self.low)

    def random(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Uniformly random controllers, ``(count, D)``."""
        return rng.uniform(self.first_low, self.first_high, (count, self.size))

    def controllers(self, vectors: np.ndarray) -> list[Any]:
        """Controllers of vectors ``(N, D)``, which are clipped to the bounds.

        Raises:
            BnsError: vectors of another length, NaN or infinity.
        """
        vectors = np.asarray(vectors, dtype=np.float64)
        if vectors.ndim != 2 or vectors.shape[1] != self.size:
            raise BnsError(
                f"Vectors of shape {vectors.shape} are no controllers of this task: "
                f"they need (N, {self.size})."
            )
        if not np.isfinite(vectors).all():
            raise BnsError("A controller holds NaN or infinity; give finite numbers.")
        return self.decode(vectors.clip(self.low, self.high))


@dataclass(frozen=True)
class Curve:
    """The figure of the record that says how well a run does.

    Attributes:
        column: of the record.
        label: of the axis.
        title: of the figure.
        log: whether the axis is logarithmic; then the mean is drawn, too.
        chart: title of the chart in a recording.
        marks: values with a dotted line, and what it says; "" = nothing.
    """

    column: str = "fitness"
    label: str = "fitness (lower is better)"
    title: str = "Fitness in the world"
    log: bool = True
    chart: str = "Fitness over trials (log10, lower is better; brown: damaged)"
    marks: tuple[tuple[float, str], ...] = ()


@dataclass(frozen=True)
class Picture:
    """What reports and recordings show of a task.

    Attributes:
        name: of the task, in a word or two.
        solved: what it means to have solved it.
        order: names of the objectives in the order in which they are to be reached.
        objectives: where they are [m], by name.
        radius: of the disc that is drawn at each [m].
        discs: what the discs mean, in a sentence.
        extent: half width and half depth of what matters [m].
        curve: how well a run does.
        reached: title of the figure of objectives reached.
        wheels: whether what is sent are wheel speeds, to be shown over time.
        figures: of a single run, drawn before those that all tasks have.
        titles, captions: of figures, where they read otherwise than is usual
            (`bns.viz.captions`, which says what may stand in braces).
        lamps: fields of each lamp that stands on the board.
        ring: radius of a circle around each lamp [m].
    """

    name: str
    solved: str
    order: tuple[str, ...]
    objectives: Mapping[str, tuple[float, float]]
    radius: float
    discs: str
    extent: tuple[float, float] = BOARD
    curve: Curve = field(default_factory=Curve)
    reached: str = "Objectives reached"
    wheels: bool = True
    figures: tuple[str, ...] = ("path",)
    titles: Mapping[str, str] = field(default_factory=dict)
    captions: Mapping[str, str] = field(default_factory=dict)
    lamps: tuple[Mapping[str, float], ...] = ()
    ring: float = 0.0


class Task(ABC):
    """What a robot has to do, for any learner.

    A module of `bns.tasks` has one subclass, `TASK`, and each TOML file there is a task
    by name: `description`, `kind` (the module) and what the kind reads of it.

    Args:
        config: of the runs.

    Raises:
        BnsError: a setting that the task cannot be with.
    """

    sections: ClassVar[tuple[str, ...]] = ()
    """sections of a configuration that belong to the task, beside `task`"""
    keys: ClassVar[tuple[str, ...] | None] = None
    """keys of its TOML file beside `description` and `kind`, others being refused;
    None, or inherited = any"""
    columns: ClassVar[Mapping[str, str]] = {}
    """per-trial figures beside fitness, fitness_best, solved, reached and commands"""
    closed_loop: ClassVar[bool] = False
    """whether controllers steer by what they sense while a trial runs"""
    from_zero: ClassVar[bool] = False
    """whether `worth` has a zero, at which nothing is achieved"""
    makes_controllers: ClassVar[tuple[str, ...]] = ()
    """sections, or settings by dotted name, on which it depends what a vector means;
    none = all of `sections`"""

    def __init__(self, config: RunConfig):
        self.config = config

    @abstractmethod
    def surroundings(self) -> dict[str, Any]:
        """What the world has to be told beside robot, damage and reality: keyword
        arguments of the world (start, lamps)."""

    def execute(
        self, world: Any, tried: Sequence[Any], *, trial: int, seeds: Sequence[int]
    ) -> list[Trial]:
        """Run each controller on a robot of its own, from the start.

        Args:
            world: where.
            tried: N controllers, as `space` decodes them.
            trial: its number.
            seeds: of what is random in the world, N.
        """
        found: list[Trial] = world.run(tried, trial=trial, seeds=seeds)
        return found

    @property
    @abstractmethod
    def space(self) -> Space:
        """All controllers that can be tried."""

    @abstractmethod
    def fitness(self, trials: Sequence[Trial]) -> np.ndarray:
        """Cost of N trials, ``(N,)``; lower is better."""

    def worth(self, trials: Sequence[Trial]) -> np.ndarray:
        """What N trials achieved, ``(N,)``; higher is better."""
        return -self.fitness(trials)

    @property
    def genotypes(self) -> dict[str, Space]:
        """Spaces that hold some or all controllers, by name; `space` is "vector"."""
        return {"vector": self.space}

    @property
    def searched(self) -> Space:
        """The smallest of `genotypes`: where learners search that have the choice."""
        return min(self.genotypes.values(), key=lambda space: space.size)

    @property
    def unknowns(self) -> tuple[str, ...]:
        """What may be wrong with its robots, for learners that fit their model.

        Effects as text with a range, "wheel_gain:wheel=left,factor=0.2..1.2".
        """
        return ()

    def behaviour(self, trials: Sequence[Trial]) -> np.ndarray:
        """How, not how well, N trials went: ``(N, B)``, each from 0 to 1.

        As a rule where they ended: x and y as shares of the board.
        """
        ends = [seen_places(trial.command_poses_world)[-1] for trial in trials]
        found: np.ndarray = (np.array(ends) / BOARD + 1.0) / 2.0
        return found.clip(0.0, 1.0)

    @abstractmethod
    def measured(self, tried: Sequence[Trial]) -> Arrays:
        """What the record keeps of a trial of each of R runs.

        Returns:
            Figures ``(R,)``: fitness, solved, reached, commands and `columns`; arrays
            with the run first: sent ``(R, K, C)``, poses ``(R, K + 1, 3)``.
        """

    @property
    @abstractmethod
    def picture(self) -> Picture:
        """What reports and recordings show."""

    def finish(self, poses_world: np.ndarray) -> int:
        """Row of the poses at which the task was done; the last one if it was not.

        Args:
            poses_world: at the start and after each command, ``(K + 1, 3)``.
        """
        return len(poses_world) - 1

    def durations(self, record: "RunRecord", at: tuple[Any, Any]) -> np.ndarray:
        """How long each command of some trials took [s].

        Args:
            record: a batch.
            at: index of replicates and trials.

        Returns:
            ``(..., K)``, NaN beyond a list's end.
        """
        found: np.ndarray = record.sent[at][..., 2]
        return found

    def problem(self) -> "type[Problem]":
        """What the BNS learner needs beside: genes, networks, and controllers' worth
        inside them.

        Raises:
            BnsError: BNS cannot learn this task.
        """
        raise BnsError(
            f"The learner 'bns' has no simulator network for the task "
            f"{self.config.task.name!r}: give --learner random or cma."
        )


def seen_places(poses_world: np.ndarray) -> np.ndarray:
    """Positions with lost ones replaced by the last seen; a lost start by the first.

    Args:
        poses_world: ``(K + 1, 3)``, NaN where lost.

    Returns:
        ``(K + 1, 2)`` [m]; 0 where nothing was seen at all.
    """
    places = poses_world[:, :2]
    known = np.isfinite(places).all(1)
    first = int(known.argmax())
    last = np.maximum.accumulate(np.where(known, np.arange(len(places)), first))
    found: np.ndarray = np.nan_to_num(places[last])
    return found
