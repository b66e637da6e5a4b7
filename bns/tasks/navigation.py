"""Navigation: objectives to reach in order by lists of wheel commands.

Scores are costs in the dissertation's unit, the centimetre (Algorithm 5, p. of
section 4.2.4): lower is better.
"""

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch
from torch import Tensor

from bns.evolution.chromosome import Encoding, Population
from bns.experiment.config import RunConfig
from bns.experiment.task_settings import TaskConfig
from bns.tasks.base import Arrays, Curve, Picture, Space, Task, seen_places
from bns.tasks.route_file import objectives, order, stops
from bns.worlds.trial import Commands, Trial

if TYPE_CHECKING:
    from bns.learners.bns.problem import Problem

CENTIMETRES = 100.0  # [cm/m]
MARGIN = 0.25
"""m of board shown around the outermost objectives"""


class PathGoal(Protocol):
    """What a path is worth, for lists of wheel commands."""

    @property
    def start(self) -> tuple[float, float, float]:
        """Start pose in the world frame [m, m, rad]."""

    def judge(self, x: Tensor, y: Tensor, yaw: Tensor, lengths: Tensor) -> Tensor:
        """Cost of paths, ``(...)``; lower is better.

        Args:
            x, y, yaw: pose after each command in the world frame, ``(K, ...)`` [m, m,
                rad]; beyond a list's end they repeat the last one.
            lengths: commands in each list, ``(...)``.
        """


@dataclass(frozen=True)
class Route:
    """A fixed order of objectives.

    Attributes:
        goals: positions in order, shape ``(G, 2)`` [m].
        config: how paths are scored.
    """

    goals: Tensor
    config: TaskConfig

    @classmethod
    def of(cls, config: TaskConfig, device: str = "cpu") -> "Route":
        """The route a configuration asks for.

        Raises:
            BnsError: as `stops`.
        """
        return cls(torch.tensor(stops(config), device=device), config)

    @property
    def start(self) -> tuple[float, float, float]:
        """Start pose in the world frame [m, m, rad]: E, heading `start_yaw`."""
        return 0.0, 0.0, math.radians(self.config.start_yaw)

    def score(self, x: Tensor, y: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """Cost of paths and how many objectives each reached.

        Args:
            x, y: position after each command in the world frame, ``(K, ...)`` [m];
                beyond a list's end they repeat the last one.
            lengths: commands in each list, ``(...)``.

        Returns:
            cost ``(...)`` and objectives reached ``(...)`` (int64).
        """
        return score(x, y, lengths, self.goals.tolist(), self.config)

    def judge(self, x: Tensor, y: Tensor, yaw: Tensor, lengths: Tensor) -> Tensor:
        """See `PathGoal.judge`; the heading does not matter."""
        del yaw
        return self.score(x, y, lengths)[0]


def score(
    x: Tensor,
    y: Tensor,
    lengths: Tensor,
    goals: list[list[float]],
    config: TaskConfig,
) -> tuple[Tensor, Tensor]:
    """Algorithm 5 with its two readings as switches; see `Route.score`.

    Commands after the last objective cost nothing but `command_cost`; with
    `charge_unused`, places beyond the list cost the standing robot's distance.

    Args:
        x, y: position after each command in the world frame, ``(K, ...)`` [m].
        lengths: commands in each list, ``(...)``.
        goals: east and north of each objective, in order [m].
        config: how paths are scored.

    Returns:
        cost ``(...)`` and objectives reached ``(...)`` (int64).
    """
    count, radius = len(goals), config.radius * CENTIMETRES
    active = torch.zeros_like(lengths)
    total = config.command_cost * lengths.to(x.dtype)
    for place in range(x.shape[0]):
        goal_x, goal_y = torch.zeros_like(total), torch.zeros_like(total)
        for number, (east, north) in enumerate(goals):
            goal_x = torch.where(active == number, east, goal_x)
            goal_y = torch.where(active == number, north, goal_y)
        dx = (x[place] - goal_x) * CENTIMETRES
        dy = (y[place] - goal_y) * CENTIMETRES
        square = dx.square() + dy.square()
        distance = square.sqrt()
        open_goal, used = active < count, place < lengths
        counts = open_goal & used if not config.charge_unused else open_goal
        total = total + torch.where(counts, square if config.squared else distance, 0.0)
        active = active + (used & open_goal & (distance < radius))
    return total + config.penalty * (count - active).to(x.dtype), active


def score_trials(
    route: Route, trials: Sequence[Trial], longest: int
) -> tuple[Tensor, Tensor]:
    """Cost of N trials and how many objectives each reached, ``(N,)`` both.

    Args:
        route: on the CPU.
        trials: what was observed; a lost position counts as the last one seen.
        longest: commands of the longest list that is possible, K.
    """
    places = np.zeros((2, longest, len(trials)))
    for index, trial in enumerate(trials):
        seen = seen_places(trial.command_poses_world)
        count = len(trial.commands)
        places[:, :count, index] = seen[1:].T
        places[:, count:, index] = seen[-1:].T
    lengths = torch.tensor([len(trial.commands) for trial in trials])
    x, y = torch.from_numpy(places)
    return route.score(x, y, lengths)


class WheeledTask(Task):
    """A task for a robot on wheels that executes a list of commands blindly.

    Controllers are lists of (left speed, right speed, duration). A vector holds those
    of `max_commands` commands and, last, how many of them there are.
    """

    sections = ("controller",)

    @cached_property
    def encoding(self) -> Encoding:
        """What the genes of a list may be."""
        return Encoding.of(self.config.controller)

    @property
    def space(self) -> Space:
        """See `Task.space`."""
        encoding = self.encoding
        low, high = (np.tile(e.numpy(), encoding.max_commands) for e in
                     (encoding.low, encoding.high))  # fmt: skip
        shortest, longest = encoding.initial
        fixed = self.config.controller.fixed_length
        least = encoding.max_commands if fixed else 1
        return Space(
            low=np.append(low, least).astype(np.float64),
            high=np.append(high, encoding.max_commands).astype(np.float64),
            first_low=np.append(low, shortest).astype(np.float64),
            first_high=np.append(high, longest).astype(np.float64),
            decode=self._decode,
        )

    def _decode(self, vectors: np.ndarray) -> list[Commands]:
        encoding = self.encoding
        genes = torch.from_numpy(vectors[:, :-1].astype(np.float32))
        genes = genes.view(len(vectors), 1, encoding.max_commands, 3)
        genes = torch.minimum(torch.maximum(genes, encoding.low), encoding.high)
        lengths = torch.from_numpy(np.rint(vectors[:, -1:]).astype(np.int64))
        return encoding.commands(Population(genes, lengths))

    @abstractmethod
    def path_goal(self, device: str = "cpu") -> PathGoal:
        """What paths are worth, in the world and inside an SNN."""

    def surroundings(self) -> dict[str, Any]:
        """Where the robot starts."""
        return {"start": self.path_goal().start}

    @property
    def unknowns(self) -> tuple[str, ...]:
        """The gains of both wheels."""
        gain = "wheel_gain:wheel={},factor=0.2..1.2"
        return tuple(gain.format(side) for side in ("left", "right"))

    def problem(self) -> "type[Problem]":
        """See `Task.problem`."""
        from bns.learners.bns.navigation import WheeledProblem

        return WheeledProblem

    def told_and_seen(self, tried: Sequence[Trial]) -> Arrays:
        """Commands sent and poses seen, padded with NaN, and how many commands."""
        longest = self.config.controller.max_commands
        sent = np.full((len(tried), longest, 3), np.nan)
        poses = np.full((len(tried), longest + 1, 3), np.nan)
        for run, trial in enumerate(tried):
            count = len(trial.commands)
            sent[run, :count, :2] = trial.commands.values[:, :2]
            sent[run, :count, 2] = trial.commands.durations
            poses[run, : count + 1] = trial.command_poses_world
        commands = np.array([len(trial.commands) for trial in tried], np.float64)
        return {"sent": sent, "poses": poses, "commands": commands}


class NavigationTask(WheeledTask):
    """Objectives that are to be reached in order."""

    keys = ("order", "objectives")

    def __init__(self, config: RunConfig):
        super().__init__(config)
        stops(config.task)

    @cached_property
    def route(self) -> Route:
        """The objectives, on the CPU."""
        return Route.of(self.config.task)

    def path_goal(self, device: str = "cpu") -> Route:
        """See `WheeledTask.path_goal`."""
        return Route.of(self.config.task, device)

    def fitness(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `Task.fitness`; Algorithm 5 as in `score`."""
        return self._scored(trials)[0]

    def _scored(self, trials: Sequence[Trial]) -> tuple[np.ndarray, np.ndarray]:
        longest = self.config.controller.max_commands
        cost, reached = score_trials(self.route, trials, longest)
        return cost.numpy(), reached.double().numpy()

    def measured(self, tried: Sequence[Trial]) -> Arrays:
        """See `Task.measured`; `reached` counts objectives."""
        fitness, reached = self._scored(tried)
        return {
            "fitness": fitness,
            "reached": reached,
            "solved": (reached == len(self.route.goals)).astype(np.float64),
            **self.told_and_seen(tried),
        }

    @property
    def picture(self) -> Picture:
        """See `Task.picture`."""
        config, letters = self.config.task, tuple(order(self.config.task.name))
        places = {n: at for n, at in objectives(config).items() if n in letters}
        half = np.abs(list(places.values())).max(axis=0) + MARGIN
        penalty, count = config.penalty, len(letters)
        marks = ((penalty, "1 missed"), (count * penalty, f"all {count} missed"))
        return Picture(
            name=config.name,
            solved="all objectives reached",
            order=letters,
            objectives=places,
            radius=config.radius,
            discs=(
                "Discs are the objectives; their size is the distance within which one "
                "counts as reached; a solid trail gets thin once all are."
            ),
            extent=(float(half[0]), float(half[1])),
            curve=Curve(marks=marks if penalty > 0 else ()),
            captions=CAPTIONS,
        )

    def finish(self, poses_world: np.ndarray) -> int:
        """Row at which the last objective was reached; see `Task.finish`."""
        row = 0
        for goal in stops(self.config.task):
            away = np.hypot(*(poses_world[row + 1 :, :2] - goal).T)
            near = np.flatnonzero(away < self.config.task.radius)
            if not len(near):
                return len(poses_world) - 1
            row += 1 + int(near[0])
        return row


CAPTIONS = {
    "path": (
        "One run, chosen as the typical one. Solid: where the robot went. {foreseen}"
        "Discs are the objectives, reached in the order {order}; within their radius "
        "counts as reached; what follows the last one is faint. Paths are cut at the "
        "board's edge.{parted}"
    ),
    "fitness": (
        "Cost of the controller tried in each trial, lower is better, on a "
        "logarithmic axis: each objective missed costs {penalty:g}, so the curve "
        "falls in steps as more objectives are reached. The dotted line is the mean, "
        "which a few failing runs dominate. {band}"
    ),
    "solved": (
        "First: objectives reached in order, of {goals}. Then: share of runs whose "
        "trial reached them all. {band}"
    ),
}
"""How to read figures of navigation."""

TASK = NavigationTask
