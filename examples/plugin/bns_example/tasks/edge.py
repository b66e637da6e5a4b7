"""A task: get to the board's upper edge."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from bns.experiment.task_settings import TaskConfig
from bns.tasks import registry
from bns.tasks.base import BOARD, Arrays, Picture
from bns.tasks.navigation import CENTIMETRES, WheeledTask
from bns.worlds.trial import Trial


@dataclass(frozen=True)
class Edge:
    """The upper edge of the board, a `bns.tasks.navigation.PathGoal`."""

    config: TaskConfig

    @property
    def start(self) -> tuple[float, float, float]:
        """Start pose in the world frame [m, m, rad]: the centre."""
        return 0.0, 0.0, math.radians(self.config.start_yaw)

    def judge(
        self,
        x: torch.Tensor,
        y: torch.Tensor,
        yaw: torch.Tensor,
        lengths: torch.Tensor,
    ) -> torch.Tensor:
        """See `PathGoal.judge`: what is left to the edge [cm], and cost of commands."""
        del x, yaw
        commands = self.config.command_cost * lengths.to(y.dtype)
        return CENTIMETRES * (BOARD[1] - y[-1]).abs() + commands


class EdgeTask(WheeledTask):
    """Get to the upper edge."""

    def path_goal(self, device: str = "cpu") -> Edge:
        """See `WheeledTask.path_goal`."""
        del device
        return Edge(self.config.task)

    def _left(self, trials: Sequence[Trial]) -> np.ndarray:
        """What was left to the edge where each was last seen, ``(N,)`` [m]."""
        rows = [trial.command_poses_world[:, 1] for trial in trials]
        return np.array([BOARD[1] - row[np.isfinite(row)][-1] for row in rows])

    def fitness(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `Edge.judge`."""
        counts = np.array([len(trial.commands) for trial in trials])
        cost = self.config.task.command_cost
        return CENTIMETRES * np.abs(self._left(trials)) + cost * counts

    def measured(self, tried: Sequence[Trial]) -> Arrays:
        """See `Task.measured`."""
        near = registry.content(self.config.task.name)["near"]
        there = (self._left(tried) < near).astype(np.float64)
        fitness = self.fitness(tried)
        seen = self.told_and_seen(tried)
        return {"fitness": fitness, "reached": there, "solved": there, **seen}

    @property
    def picture(self) -> Picture:
        """See `Task.picture`."""
        return Picture(
            name="edge",
            solved="near the upper edge",
            order=("E",),
            objectives={"E": (0.0, BOARD[1])},
            radius=self.config.task.radius,
            discs="The disc is the middle of the upper edge.",
        )


TASK = EdgeTask
