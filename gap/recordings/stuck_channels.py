"""Channels that stand still while the robot moves."""

import numpy as np

from bns.gap.models.base import GapModel
from bns.worlds.trial import Trial

RUN = 8  # equal samples in a row, at least
MOVED = 20.0  # times the resolution that the model moves meanwhile, at least
SAME = 0.05  # share of repeated values from which a channel counts as coarse
STEPS = 3.0  # times the smallest step of a quantised channel, likewise


def dropped(trial: Trial, model: GapModel) -> tuple[Trial, list[str]]:
    """Samples dropped in which a channel keeps one value though it should move.

    Args:
        trial: recorded trial.
        model: nominal model; what it predicts says what should move.

    Returns:
        the trial; a note per channel.
    """
    runs = {
        column: found
        for column in range(len(model.channels))
        if (found := _runs(trial.observed[:, column]))
    }
    if not runs:
        return trial, []
    ((predicted,),) = model.simulate([trial], [()])
    explained = model.at_rest(trial, predicted)
    observed, notes = trial.observed.copy(), []
    for column, found in runs.items():
        if model.channels[column].name in explained:
            continue
        least = _least(trial.observed[:, column], float(model.resolution[column]))
        for first, last in found:
            moved = np.ptp(predicted[first : last + 1, column])
            if not moved >= least:  # NaN where the simulation diverged
                continue
            if not _others_move(trial.observed[first : last + 1], column, model):
                continue  # the robot stands still, which is no fault of a channel
            name, unit = model.channels[column].name, model.channels[column].unit
            observed[first : last + 1] = np.nan
            seconds = trial.times[last] - trial.times[first]
            notes.append(
                f"{name} is stuck for {seconds:.3g} s, in which it should have moved "
                f"by {moved:.2g} {unit}; these samples dropped"
            )
    return (trial.replace(observed=observed) if notes else trial), notes


def _others_move(values: np.ndarray, column: int, model: GapModel) -> bool:
    """Whether another channel moves meanwhile and hardly ever repeats a value.

    Where the others repeat theirs, too, encoders are coarse or joints stick: that is
    no fault of a channel.
    """
    others = [c for c in range(len(model.channels)) if c != column]
    seen = values[np.isfinite(values).all(axis=1)][:, others]
    moved = np.ptp(seen, axis=0) > MOVED * model.resolution[others]
    repeated = (np.diff(seen, axis=0) == 0).mean(axis=0) > SAME
    return bool((moved & ~repeated).any())


def _runs(values: np.ndarray) -> list[tuple[int, int]]:
    """First and last sample of each long run of equal ones, lost ones passed over."""
    seen = np.flatnonzero(np.isfinite(values))
    if len(seen) < RUN:
        return []
    edges = np.flatnonzero(np.diff(values[seen]) != 0)
    starts = np.concatenate([[0], edges + 1])
    ends = np.concatenate([edges, [len(seen) - 1]])
    long = ends - starts + 1 >= RUN
    return [
        (int(seen[a]), int(seen[b]))
        for a, b in zip(starts[long], ends[long], strict=True)
    ]


def _least(values: np.ndarray, resolution: float) -> float:
    """Motion that would have shown."""
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    steps = steps[steps > 0]
    smallest = float(steps.min()) if len(steps) else 0.0
    coarse = len(np.unique(steps.round(12))) < len(steps) / 4  # quantised
    return max(MOVED * resolution, STEPS * smallest if coarse else 0.0)
