"""Servo trials on one regular grid, ready to be compared with simulated ones."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.errors import BnsError
from bns.gap.recordings.trial_conditions import as_number, begun
from bns.worlds.physics.servo_law import NUMBERS
from bns.worlds.physics.servo_rollout import DT, Drive
from bns.worlds.trial import Trial

SAMPLE = 0.01  # [s] grid on which recorded and simulated angles are compared


@dataclass(frozen=True, eq=False)
class Runs:
    """R runs with the same length in time.

    Attributes:
        drive: what the servos were told, and how they started.
        angles: recorded angles every `SAMPLE` seconds, shape ``(R, T)`` [rad].
        told: numbers of the servo law that are known per run, each shape ``(R,)``.
        labels: other conditions per run, each a tuple of R values.
    """

    drive: Drive
    angles: np.ndarray
    told: Mapping[str, np.ndarray]
    labels: Mapping[str, tuple]

    def __len__(self) -> int:
        return len(self.angles)

    def take(self, chosen: np.ndarray) -> "Runs":
        """Some of the runs, by index or mask ``(N,)``; an index may come more than
        once."""
        index = np.arange(len(self))[chosen]
        on = self.drive.torque_on
        return Runs(
            drive=replace(
                self.drive,
                goals=self.drive.goals[index],
                start=self.drive.start[index],
                speed=self.drive.speed[index],
                torque_on=None if on is None else on[index],
            ),
            angles=self.angles[index],
            told={name: values[index] for name, values in self.told.items()},
            labels={k: tuple(v[i] for i in index) for k, v in self.labels.items()},
        )

    def retold(self, **values: np.ndarray) -> "Runs":
        """The same runs, told something else of themselves."""
        given = {k: np.broadcast_to(v, len(self)) for k, v in values.items()}
        return replace(self, told={**self.told, **given})

    def where(self, test: Callable[..., bool], *names: str) -> np.ndarray:
        """Mask of the runs whose labels (or told numbers) pass a test."""
        columns = [self.labels.get(name, self.told.get(name)) for name in names]
        return np.array([test(*row) for row in zip(*columns, strict=True)], bool)


def runs(trials: Sequence[Trial], *, seconds: float, dt: float = DT) -> Runs:
    """Trials resampled on the regular grid.

    Goals hold from their sample to the next; angles are interpolated. The start speed
    is the slope of the first 50 ms.

    Args:
        trials: of a servo, with the channel `angle` and the command `goal`.
        seconds: length to compare; what comes after is left out.
        dt: physics step [s], a whole fraction of `SAMPLE`.

    Raises:
        BnsError: no trial, or one that is too short or lacks a channel.
    """
    if not trials:
        raise BnsError("There is no servo trial to compare; check the selection.")
    every = round(SAMPLE / dt)
    count = round(seconds / SAMPLE)
    fine = np.arange(count * every) * dt
    grid = np.arange(count + 1) * SAMPLE
    rows = [_row(trial, fine, grid) for trial in trials]
    goals, on, angles, speed = (np.stack(item) for item in zip(*rows, strict=True))
    conditions = [trial.conditions for trial in trials]
    names = sorted(set.intersection(*(set(item) for item in conditions)))
    known = [name for name in names if name in NUMBERS]
    return Runs(
        drive=Drive(
            goals=goals,
            start=angles[:, 0],
            speed=speed,
            torque_on=None if on.all() else on,
            dt=dt,
            every=every,
        ),
        angles=angles,
        told={n: np.array([as_number(c, n) for c in conditions]) for n in known},
        labels={n: tuple(c[n] for c in conditions) for n in names if n not in NUMBERS},
    )


def _row(trial: Trial, fine: np.ndarray, grid: np.ndarray) -> tuple:
    times, angle = trial.times, trial.channel("angle")
    if times[-1] < grid[-1] - 3 * SAMPLE:
        raise BnsError(
            f"A servo trial lasts {times[-1]:.2f} s, less than {grid[-1]:g}."
        )
    index = np.searchsorted(begun(trial), fine + 1e-9, side="right") - 1
    names = [channel.name for channel in trial.commands.channels]
    told = trial.commands.values[np.maximum(index, 0)]
    on = told[:, names.index("torque_on")] > 0.5
    early = times <= 0.05
    speed = np.polyfit(times[early], angle[early], 1)[0] if early.sum() > 2 else 0.0
    return told[:, names.index("goal")], on, np.interp(grid, times, angle), speed


CELL = ("mass", "lever", "gain")
"""what tells one setting of the servo from another"""


def cells(runs: Runs) -> list[tuple[float, ...]]:
    """The setting of each run, rounded so that equal ones compare equal."""
    columns = [np.round(runs.told[name], 6).tolist() for name in CELL]
    return list(zip(*columns, strict=True))


def merged(runs: Runs) -> Runs:
    """Repeats as one run: same setting, same trajectory; angles are averaged.

    Goals are those of the first; start and speed are medians, so that one odd start
    does not matter.
    """
    keys = list(zip(cells(runs), runs.labels["trajectory"], strict=True))
    groups: dict[tuple, list[int]] = {}
    for index, key in enumerate(keys):
        groups.setdefault(key, []).append(index)
    first = runs.take(np.array([group[0] for group in groups.values()]))
    parts = list(groups.values())
    drive = replace(
        first.drive,
        start=np.array([np.median(runs.drive.start[part]) for part in parts]),
        speed=np.array([np.median(runs.drive.speed[part]) for part in parts]),
    )
    angles = np.stack([runs.angles[part].mean(axis=0) for part in parts])
    return replace(first, drive=drive, angles=angles)
