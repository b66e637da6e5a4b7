"""A robot that is told forward speed and turning rate, as kinematics alone.

For recordings of robots of which no more is known than what they were told and where
they were. Where a command lasts, speeds are the ones told; there is no dynamics, so
that a lag or a delay is what dynamics looks like.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from bns.gap.candidates.mjcf import EXCITE, LATE, RATIOS, OwnCandidate
from bns.gap.core import segments
from bns.gap.models.base import Windows
from bns.gap.models.mjcf import effects as own_effects
from bns.gap.records import Candidate
from bns.worlds.effects.base import ControlSignal, Effect
from bns.worlds.physics import control
from bns.worlds.trial import POSE_CHANNELS, Channel, Trial, body_displacement

STEP = 0.01  # [s] grid of the integration
WINDOW = 0.5  # [s] between two poses that are compared
LEAD = 1.0  # [s] of the first command before a trial, for what is late
FASTEST, QUICKEST = 0.5, 2.0  # [m/s], [rad/s] limits of plans; assumed
TOLD = ("forward_speed", "turning_rate")
SLIGHT = (0.8, 0.9, 0.95, 1.05, 1.1, 1.25)


class UnicycleModel:
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
            TOLD[0]: (-FASTEST, FASTEST, "m/s"),
            TOLD[1]: (-QUICKEST, QUICKEST, "rad/s"),
        }

    dt = STEP

    @staticmethod
    def parse(text: str) -> Effect:
        """An effect on this model, as a diagnosis writes it."""
        return own_effects.parse(text)

    def candidates(self) -> tuple[Candidate, ...]:
        """Gains, delay, lag, offset and dead zones, in a fixed order."""
        made = [
            _candidate("command_gain", TOLD[0], "1", 1.0, RATIOS[1], 1.6, SLIGHT),
            _candidate("command_gain", TOLD[1], "1", 1.0, RATIOS[1], 1.6, SLIGHT),
            _candidate("command_delay", "all", "s", 0.0, 0.0, 1.0, (*LATE, 1.0)),
            _candidate("command_lag", "all", "s", 0.0, 0.0, 1.0, (*LATE, 1.0)),
        ]
        for channel, unit, size in ((TOLD[0], "m/s", 0.1), (TOLD[1], "rad/s", 0.3)):
            grid = tuple(size * share for share in (0.03, 0.1, 0.3, 1.0))
            both = tuple(sorted((*grid, *(-value for value in grid))))
            made.append(
                _candidate("command_offset", channel, unit, 0.0, -size, size, both)
            )
            made.append(
                _candidate("command_dead_zone", channel, unit, 0.0, 0.0, size, grid)
            )
        return tuple(made)

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


def _candidate(effect, part, unit, nominal, low, high, grid) -> OwnCandidate:
    return OwnCandidate(
        name=f"{effect}[{part}]",
        effect=effect,
        parameter=own_effects.CLASSES[effect].parameters[0].name,
        unit=unit,
        nominal=nominal,
        low=low,
        high=high,
        grid=tuple(grid),
        fixed={"part": part},
        excite=EXCITE[effect],
    )


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
        signal = ControlSignal(times, values, command, TOLD, STEP)
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
    at = trial.times - trial.times[trial.boundaries[0]]
    grid = np.arange(made.shape[1]) * STEP
    return np.stack([np.interp(at, grid, axis) for axis in made], axis=1)
