"""A robot that is told forward speed and turning rate, as kinematics alone.

For recordings of robots of which no more is known than what they were told and where
they were. Where a command lasts, speeds are the ones told; there is no dynamics, so
that a lag or a delay is what dynamics looks like.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from bns.gap.candidates import unicycle_rows
from bns.gap.decomposition.row import Row
from bns.gap.models.base import GapModel, Windows
from bns.gap.recordings import segments
from bns.worlds.effects.base import (
    CommandEffect,
    ControlSignal,
    Effect,
    PoseSignal,
    TrackingEffect,
)
from bns.worlds.effects.command import TWIST
from bns.worlds.physics import control
from bns.worlds.trial import POSE_CHANNELS, Channel, Trial, body_displacement

STEP = 0.01  # [s] grid of the integration
WINDOW = 0.5  # [s] between two poses that are compared
LEAD = 1.0  # [s] of the first command before a trial, for what is late
FASTEST, QUICKEST = 0.5, 2.0  # [m/s], [rad/s] limits of plans; assumed
LEAST = (5e-4, 5e-4, 2e-3)  # [m, m, rad] smallest believed deviations; assumed


class UnicycleModel(GapModel):
    """Kinematics of a robot told forward speed and turning rate.

    Args:
        name: of the robot that was recorded.
        process, resolution: see `GapModel` [m, m, rad]; assumed.
    """

    channels = POSE_CHANNELS
    features = (Channel("forward", "m"), Channel("left", "m"), Channel("turn", "rad"))

    def __init__(
        self,
        name: str = "irobot_create",
        *,
        process: Sequence[float] = (5e-3, 3e-3, 2e-2),
        resolution: Sequence[float] = (5e-4, 5e-4, 2e-3),
    ):
        self.name = name
        self.process = np.array(process, dtype=float)
        self.resolution = np.array(resolution, dtype=float)
        self.limits = {
            TWIST[0]: (-FASTEST, FASTEST, "m/s"),
            TWIST[1]: (-QUICKEST, QUICKEST, "rad/s"),
        }

    dt = STEP
    one_step = True

    @property
    def least(self) -> np.ndarray:
        """Smallest believed standard deviation of each feature [m, m, rad]."""
        return np.array(LEAST)

    def rows(self, trials: Sequence[Trial]) -> tuple[Row, ...]:
        """All numbers that may be off; the same whatever was told."""
        del trials
        return unicycle_rows.rows()

    def effect(self, term: str, values: Mapping[str, float]) -> Effect:
        """The effect of an explanation."""
        (made,) = unicycle_rows.effects({term: values[term]})
        return made

    def paths(
        self,
        trials: Sequence[Trial],
        sets: Sequence[Sequence[Mapping[str, float]]],
        *,
        fine: bool = True,
    ) -> list[list[np.ndarray]]:
        """See `GapModel.paths`: poses, each ``(T, 3)``; there is one step."""
        del fine
        return [
            [
                _path(trial, unicycle_rows.effects(values))
                for trial, values in zip(trials, row, strict=True)
            ]
            for row in sets
        ]

    def joint_windows(self, trial: Trial) -> Windows:
        """Windows of `WINDOW` between seen samples, half overlapping."""
        return segments.overlapping(trial, WINDOW)

    def motion(self, features: np.ndarray) -> np.ndarray:
        """Speed of each feature over a window."""
        return np.abs(features) / WINDOW

    def simulate(
        self, trials: Sequence[Trial], effects: Sequence[Sequence[Effect]]
    ) -> list[list[np.ndarray]]:
        """See `GapModel.simulate`: predicted poses, each ``(T, 3)`` [m, m, rad]."""
        return [[_path(trial, items) for trial in trials] for items in effects]

    def windows(self, trial: Trial) -> Windows:
        """Windows between samples that were seen."""
        return segments.windows(trial, WINDOW)

    def compare(
        self, trial: Trial, observed: np.ndarray, windows: Windows
    ) -> np.ndarray:
        """See `GapModel.compare`: displacement in each window's first frame."""
        begin, end = observed[..., windows.first, :], observed[..., windows.last, :]
        return body_displacement(begin, end)

    def regime(self, trial: Trial, windows: Windows) -> Mapping[str, np.ndarray]:
        """Commands, their changes, and time, each ``(W,)``."""
        index, since, at = segments.told(trial, windows)
        told = trial.commands.values
        before = np.vstack([told[:1], told[:-1]])[index]
        return {
            "forward speed told": told[index, 0],
            "turning rate told": told[index, 1],
            "change of the speed told": told[index, 0] - before[:, 0],
            "change of the rate told": told[index, 1] - before[:, 1],
            "time since the command changed": since,
            "time in the trial": at,
        }


def _path(trial: Trial, effects: Sequence[Effect]) -> np.ndarray:
    """Poses at the trial's samples, from its first one that was seen."""
    counts = control.steps(trial.commands.durations, STEP)
    lead = round(LEAD / STEP)
    values = np.repeat(trial.commands.values, counts, axis=0)
    values = np.concatenate([np.tile(values[:1], (lead, 1)), values])
    on, rng = np.ones(len(values), bool), np.random.default_rng(0)
    command = np.repeat(np.arange(-1, len(counts)), [lead, *counts])
    times = np.arange(len(values)) * STEP
    for effect in effects:
        if isinstance(effect, CommandEffect) and effect.stage == "command":
            signal = ControlSignal(times, values, command, TWIST, STEP)
            values = effect.apply(signal, on, rng)
    speed, rate = values[lead:].T
    seen = trial.poses_world[np.isfinite(trial.poses_world).all(axis=1)]
    x, y, yaw = seen[0]
    turned = yaw + np.concatenate([[0.0], np.cumsum(rate * STEP)])
    middle = (turned[1:] + turned[:-1]) / 2
    made = np.stack(
        [
            x + np.concatenate([[0.0], np.cumsum(speed * np.cos(middle) * STEP)]),
            y + np.concatenate([[0.0], np.cumsum(speed * np.sin(middle) * STEP)]),
            turned,
        ]
    )
    grid = np.arange(made.shape[1]) * STEP
    poses, always = made.T, np.ones(len(grid), bool)
    for effect in effects:
        if isinstance(effect, TrackingEffect):
            _, poses = effect.apply(PoseSignal(grid, poses, grid, poses), always, rng)
    at = trial.times - trial.times[trial.boundaries[0]]
    return np.stack([np.interp(at, grid, axis) for axis in poses.T], axis=1)
