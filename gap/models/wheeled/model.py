"""A wheeled robot as a nominal model for the diagnosis."""

from collections.abc import Mapping, Sequence

import numpy as np

from bns import models
from bns.errors import BnsError
from bns.gap.candidates import wheeled_rows
from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel, Windows
from bns.gap.models.wheeled import changes, drives
from bns.gap.recordings import segments as pieces
from bns.worlds.effects.base import Effect
from bns.worlds.physics import compile
from bns.worlds.physics.rollout import Pool
from bns.worlds.trial import POSE_CHANNELS, Channel, Trial, body_displacement

WINDOW = 0.1  # [s] shortest piece of motion that is compared
HORIZON = 0.4  # [s] over which motion is compared in the joint fit, half overlapping
LEAST = (2e-4, 2e-4, 1e-3)  # [m, m, rad] smallest believed deviations over it; assumed
LONGEST = 150.0  # [s] of driving that are fitted: what a few minutes' session gives
BEFORE = 1.5  # [s] until wheels with a lag of up to 0.5 s follow as the robot's do


class WheeledModel(GapModel):
    """A differential-drive robot in MuJoCo, seen by an overhead tracker.

    Args:
        robot: name of the robot model, of kind "wheeled".
        threads: of the physics.
        process: see `GapModel.process` [m, m, rad per square root of a second].
        resolution: see `GapModel.resolution` [m, m, rad].

    Raises:
        BnsError: the robot has no wheels.
    """

    channels = POSE_CHANNELS
    features = (Channel("forward", "m"), Channel("left", "m"), Channel("turn", "rad"))
    longest, before = LONGEST, BEFORE

    def __init__(
        self,
        robot: str = "khepera3",
        *,
        threads: int = 2,
        process: Sequence[float] = (1e-4, 5e-5, 1e-3),
        resolution: Sequence[float] = (1e-4, 1e-4, 1e-3),
    ):
        self._robot = models.robot(robot)
        if self._robot.kind != "wheeled":
            raise BnsError(f"{robot!r} has no wheels; take a wheeled robot.")
        self.name = robot
        self.dt = float(compile.compiled(robot).model.opt.timestep)
        self.process = np.array(process, dtype=float)
        self.resolution = np.array(resolution, dtype=float)
        self.limits = {c.name: (c.low, c.high, c.unit) for c in self._robot.commands}
        self._drives = drives.Drives(robot, Pool(threads))

    @property
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of each feature [m, m, rad]."""
        return np.array(LEAST)

    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """All numbers of a wheeled robot that may be off."""
        return wheeled_rows.rows(trials)

    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """See `GapModel.paths`: poses, each ``(T, 3)`` [m, m, rad]."""
        return self._drives.paths(trials, sets, fine=fine)

    def joint_windows(self, trial: Trial) -> Windows:
        """Windows of `HORIZON` between seen samples, half overlapping."""
        return pieces.overlapping(trial, HORIZON)

    def motion(self, features: np.ndarray) -> np.ndarray:
        """Speed of each feature over a window."""
        return np.abs(features) / HORIZON

    def effect(self, term: str, values: Mapping[str, float]) -> Effect:
        """The effect of an explanation."""
        return changes.effect(term, values)

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: predicted poses, each ``(T, 3)`` [m, m, rad]."""
        return self._drives.with_effects(trials, effects)

    def windows(self, trial: Trial) -> Windows:
        """Windows between samples that were seen, `WINDOW` long or more."""
        return pieces.windows(trial, WINDOW)

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """See `GapModel.compare`: displacement in each window's first frame."""
        begin, end = observed[..., windows.first, :], observed[..., windows.last, :]
        return body_displacement(begin, end)

    def patterns(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """See `GapModel.patterns`: harmonics of the heading; the place with its pull
        in the robot's frame."""
        x, y, yaw = pieces.coarse(trial.poses_world[windows.first]).T
        ahead, aside = np.cos(yaw), np.sin(yaw)
        heading = [ahead, aside, np.cos(2 * yaw), np.sin(2 * yaw)]
        place = [x, y, x**2, y**2, x * y]
        pull = [ahead * x, ahead * y, aside * x, aside * y]
        return {
            "the heading": np.stack(heading, axis=1),
            "the place": np.stack([*place, *heading, *pull], axis=1),
        }

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """Commands, their signs, changes, pose and time in each window."""
        index, since, at = pieces.told(trial, windows)
        told = trial.commands.values
        before = np.vstack([np.zeros(2), told])[index]
        pose = pieces.coarse(trial.poses_world[windows.first])
        now = told[index]
        return {
            "speed told to the left wheel [m/s]": now[:, 0],
            "speed told to the right wheel [m/s]": now[:, 1],
            "change of the left wheel's command [m/s]": now[:, 0] - before[:, 0],
            "change of the right wheel's command [m/s]": now[:, 1] - before[:, 1],
            "time since the command changed [s]": since,
            "forward speed told [m/s]": now.mean(axis=1),
            "turn told [m/s]": now[:, 1] - now[:, 0],
            "heading": np.angle(np.exp(1j * pose[:, 2])),
            "x [m]": pose[:, 0],
            "y [m]": pose[:, 1],
            "time in the trial [s]": at,
        }
