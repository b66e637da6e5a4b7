"""What a recording scatters by itself: measurement noise and repeatability."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bns.gap.core import repeats
from bns.gap.models.base import GapModel, Windows
from bns.worlds.trial import Trial

# Third differences of independent noise have a variance of 1 + 9 + 9 + 1 = 20.
THIRD = np.sqrt(20.0)
QUANTILE, NORMAL = 0.5, 0.67449  # share, and the median of |N(0, 1)|
REPEATS = 2  # trials with the same commands that make a floor
MANY = 150  # windows of a trial whose scatter is looked at together
MOTION = 1e-6  # step of numerical derivatives, in the channel's unit


@dataclass(frozen=True, eq=False)
class Floor:
    """Scatter that no effect explains.

    Attributes:
        sigma: standard deviation of the measurement by observed channel.
        process: of the motion itself, per square root of a second, by feature.
        source: "repeats" or "state reset".
        repeats: groups of trials with the same commands.
    """

    sigma: np.ndarray
    process: np.ndarray
    source: str
    repeats: int


def estimate(
    model: GapModel, trials: Sequence[Trial], predicted: Sequence[np.ndarray]
) -> Floor:
    """The floor of a recording.

    The measurement's noise comes from third differences of the recording (and of what
    it departs from the nominal prediction; the smaller counts), which motion hardly
    touches. What the motion scatters comes from repeats of the same commands where
    there are any, else from the model.

    Args:
        model: nominal model.
        trials: the recording.
        predicted: nominal prediction of each trial.
    """
    units = np.array([channel.unit for channel in model.channels])
    sigma = _measurement(trials, predicted)
    for unit in set(units):  # channels of one unit come from one instrument
        sigma[units == unit] = np.sqrt((sigma[units == unit] ** 2).mean())
    sigma = np.maximum(sigma, model.resolution)
    groups = _repeats(trials)
    if not groups:
        return Floor(sigma, np.asarray(model.process), "state reset", 0)
    spread = _between(model, groups, sigma)
    return Floor(
        sigma, np.maximum(spread, 1e-3 * model.process), "repeats", len(groups)
    )


def _measurement(
    trials: Sequence[Trial], predicted: Sequence[np.ndarray]
) -> np.ndarray:
    pieces: tuple[list, list] = ([], [])
    for trial, simulated in zip(trials, predicted, strict=True):
        seen = trial.observed[:, : simulated.shape[1]]  # further channels do not count
        for kept, series in zip(pieces, (seen, seen - simulated), strict=True):
            third = np.diff(series, n=3, axis=0)
            kept.append(np.abs(third[np.isfinite(third).all(axis=1)]))
    found = [
        np.quantile(np.concatenate(kept), QUANTILE, axis=0) / NORMAL / THIRD
        for kept in pieces
        if sum(map(len, kept)) > 10
    ]
    return np.min(found, axis=0) if found else np.zeros(predicted[0].shape[1])


def _repeats(trials: Sequence[Trial]) -> list[list[Trial]]:
    groups: dict[bytes, list[Trial]] = {}
    for trial in trials:
        told = trial.commands.values.tobytes() + trial.commands.durations.tobytes()
        same = groups.setdefault(told, [])
        if not same or len(same[0].times) == len(trial.times):
            same.append(trial)
    return [group for group in groups.values() if len(group) >= REPEATS]


def _between(
    model: GapModel, groups: Sequence[Sequence[Trial]], sigma: np.ndarray
) -> np.ndarray:
    """Scatter between repeats beyond the measurement's, see `repeats.scatter`."""
    values, noise, spans = [], [], []
    for group in groups:
        windows = model.windows(group[0])
        length = windows.durations.sum() / MANY
        if len(windows) > MANY:
            windows = coarser(windows, length)
        values.append(
            np.stack([model.compare(trial, trial.observed, windows) for trial in group])
        )
        jacobian = derivative(model, group[0], windows) * sigma
        flat = jacobian.reshape(len(jacobian), -1)
        noise.append(flat @ flat.T)
        spans.append(windows)
    return repeats.scatter(values, noise, spans, np.asarray(model.process, dtype=float))


def coarser(windows: Windows, length: float) -> Windows:
    """Windows of at least a length [s], made of whole given ones."""
    first, last, begin = [], [], 0
    ends = windows.times + windows.durations / 2
    starts = windows.times - windows.durations / 2
    for end in range(len(windows)):
        if ends[end] - starts[begin] >= 0.97 * length or (
            np.isinf(length) and end == len(windows) - 1
        ):
            first.append(begin)
            last.append(end)
            begin = end + 1
    first, last = np.array(first, dtype=int), np.array(last, dtype=int)
    span = ends[last] - starts[first]
    return Windows(
        windows.first[first], windows.last[last], starts[first] + span / 2, span
    )


def derivative(model: GapModel, trial: Trial, windows: Windows) -> np.ndarray:
    """Derivative of the features by the observations, ``(W * C, T, n_channels)``.

    Args:
        model: nominal model.
        trial: recorded trial; what was not seen counts as zero.
        windows: W windows into it.
    """
    seen = np.where(np.isfinite(trial.observed), trial.observed, 0.0)
    count, channels = seen.shape
    moved = np.repeat(seen[None], count * channels, axis=0)
    flat = moved.reshape(count * channels, -1)
    flat[np.arange(count * channels), np.arange(count * channels)] += MOTION
    base = model.compare(trial, seen, windows)
    change = (model.compare(trial, moved, windows) - base) / MOTION
    return change.reshape(count * channels, -1).T.reshape(-1, count, channels)
