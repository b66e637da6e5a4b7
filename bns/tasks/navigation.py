"""Navigation tasks: objectives to reach in order, and how a path is scored.

Scores are costs in the dissertation's unit, the centimetre (Algorithm 5, p. of
section 4.2.4): lower is better.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from bns.experiment.config import TaskConfig
from bns.tasks import registry

CENTIMETRES = 100.0  # [cm/m]


def objectives(config: TaskConfig) -> dict[str, tuple[float, float]]:
    """Positions of a task's objectives on the board [m], the centre E the origin.

    The dissertation gives them in a picture only; the corners are an assumption:
    A bottom right, B bottom left, C top left, D top right. A task's file may place
    its own.

    Raises:
        UnknownNameError: no such task.
    """
    own = registry.content(config.name).get("objectives")
    if own:
        return {letter: (float(x), float(y)) for letter, (x, y) in own.items()}
    x, y = config.corner_x, config.corner_y
    return {"A": (x, -y), "B": (-x, -y), "C": (-x, y), "D": (x, y), "E": (0.0, 0.0)}


@dataclass(frozen=True)
class NavigationTask:
    """A fixed order of objectives.

    Attributes:
        goals: positions in order, shape ``(G, 2)`` [m].
        config: how paths are scored.
    """

    goals: Tensor
    config: TaskConfig

    @classmethod
    def of(cls, config: TaskConfig, device: str = "cpu") -> "NavigationTask":
        """The task a configuration asks for.

        Raises:
            UnknownNameError: no such task.
        """
        places = objectives(config)
        points = [places[letter] for letter in registry.order(config.name)]
        return cls(torch.tensor(points, device=device), config)

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


def score(
    x: Tensor,
    y: Tensor,
    lengths: Tensor,
    goals: list[list[float]],
    config: TaskConfig,
) -> tuple[Tensor, Tensor]:
    """Algorithm 5 with its two readings as switches; see `NavigationTask.score`.

    Commands after the last objective cost nothing but `command_cost`; with
    `charge_unused`, places beyond the list cost the standing robot's distance.
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
