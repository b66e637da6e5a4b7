"""Parking: end at a place, heading a given way, in few commands.

Our own, no task of the dissertation: one whose score needs the heading, as the routes'
does not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from bns.errors import FormatError
from bns.experiment.task_settings import TaskConfig
from bns.tasks import registry
from bns.tasks.base import Arrays, Curve, Picture
from bns.tasks.navigation import CENTIMETRES, MARGIN, WheeledTask
from bns.tasks.route_file import on_board
from bns.worlds.trial import Trial

TURN_COST = 50.0  # [cm/rad] of heading that is wrong; assumed
WITHIN = math.radians(15)  # [rad] a heading counts as right; assumed


@dataclass(frozen=True)
class Bay:
    """Where to end, a `PathGoal`.

    Attributes:
        pose: x, y [m] and heading [rad] in the world frame.
        config: radius within which the place counts, start, cost of a command.
    """

    pose: tuple[float, float, float]
    config: TaskConfig

    @property
    def start(self) -> tuple[float, float, float]:
        """Start pose in the world frame [m, m, rad]: the centre."""
        return 0.0, 0.0, math.radians(self.config.start_yaw)

    def judge(self, x: Tensor, y: Tensor, yaw: Tensor, lengths: Tensor) -> Tensor:
        """See `PathGoal.judge`: distance [cm] and wrong heading of the end, and what
        commands cost."""
        away, wrong = self.off(x[-1], y[-1], yaw[-1])
        commands = self.config.command_cost * lengths.to(x.dtype)
        return CENTIMETRES * away + TURN_COST * wrong + commands

    def off(self, x: Tensor, y: Tensor, yaw: Tensor) -> tuple[Tensor, Tensor]:
        """How far poses are from the bay: distance [m], heading [rad], each >= 0.

        Args:
            x, y: positions in the world frame, ``(...)`` [m].
            yaw: headings, ``(...)`` [rad].

        Returns:
            distance and heading, each ``(...)``.
        """
        east, north, heading = self.pose
        wrong = torch.remainder(yaw - heading + math.pi, 2 * math.pi) - math.pi
        away = ((x - east).square() + (y - north).square() + 1e-12).sqrt()
        return away, wrong.abs()


class ParkTask(WheeledTask):
    """End in the bay that the task's file names."""

    keys = ("goal",)

    def path_goal(self, device: str = "cpu") -> Bay:
        """See `WheeledTask.path_goal`.

        Raises:
            FormatError: the file's goal is not three numbers.
            OutOfBoundsError: it is off the board.
        """
        del device
        name = self.config.task.name
        given = registry.content(name).get("goal")
        if not isinstance(given, list) or len(given) != 3:
            raise FormatError(
                f"Task {name!r}: goal = {given!r} is not allowed: give x, y [m] and "
                "heading [deg], as goal = [0.3, 0.3, 180.0]."
            )
        heading = given[2]
        if type(heading) not in (int, float) or not math.isfinite(heading):
            raise FormatError(
                f"Task {name!r}: the heading {heading!r} of goal is not allowed: give "
                "a number [deg]."
            )
        x, y = on_board(name, "goal", given[:2])
        return Bay((x, y, math.radians(heading)), self.config.task)

    def _ends(self, trials: Sequence[Trial]) -> Tensor:
        """The last pose that was seen of each, ``(3, N)``."""
        poses = [trial.command_poses_world for trial in trials]
        seen = [rows[np.isfinite(rows).all(1)] for rows in poses]
        return torch.from_numpy(
            np.stack([rows[-1] if len(rows) else np.zeros(3) for rows in seen], axis=1)
        )

    def fitness(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `Bay.judge`."""
        x, y, yaw = self._ends(trials)[:, None]
        lengths = torch.tensor([len(trial.commands) for trial in trials])
        cost: np.ndarray = self.path_goal().judge(x, y, yaw, lengths).numpy()
        return cost

    def measured(self, tried: Sequence[Trial]) -> Arrays:
        """See `Task.measured`; `reached` is 1 at the place, whatever the heading."""
        away, wrong = self.path_goal().off(*self._ends(tried))
        there = away < self.config.task.radius
        return {
            "fitness": self.fitness(tried),
            "reached": there.double().numpy(),
            "solved": (there & (wrong < WITHIN)).double().numpy(),
            **self.told_and_seen(tried),
        }

    @property
    def picture(self) -> Picture:
        """See `Task.picture`."""
        x, y, heading = self.path_goal().pose
        return Picture(
            name=self.config.task.name,
            solved="at the place, heading the right way,",
            order=("P",),
            objectives={"P": (x, y)},
            radius=self.config.task.radius,
            discs=(
                "The disc is the place to end at, heading "
                f"{math.degrees(heading):g} degrees from the board's x axis."
            ),
            extent=(abs(x) + MARGIN, abs(y) + MARGIN),
            curve=Curve(),
            reached="At the place",
            captions={
                "path": (
                    "One run, chosen as the typical one. Solid: where the robot went. "
                    "{foreseen}The disc is the place to end at."
                ),
                "fitness": (
                    "Cost of the controller tried in each trial, lower is better: "
                    "distance from the place [cm], 50 cm per radian of wrong heading, "
                    "5 cm per command. {band}"
                ),
                "solved": (
                    "First: whether the robot ended at the place. Then: share of runs "
                    "whose trial ended there, heading the right way. {band}"
                ),
            },
        )


TASK = ParkTask
