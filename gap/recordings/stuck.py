"""Channels that keep one value though what they measure moves."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from bns.gap.models.base import GapModel
from bns.worlds.trial import Trial

RUN = 8  # equal samples in a row, at least
MOVED = 20.0  # times the resolution that the model moves meanwhile, at least
SAME = 0.05  # share of repeated values from which a channel counts as coarse
CAUGHT_UP = 0.25  # of the missed way that a stuck channel jumps at least; assumed
STEPS = 3.0  # times the smallest step of a quantised channel, likewise


def without_stuck(
    trials: Sequence[Trial], model: GapModel
) -> list[tuple[Trial, list[str]]]:
    """Samples dropped in which a channel keeps one value though it should move.

    What stands still in one trial because of what it measures (a joint that is locked)
    is no fault of a channel in another, where it may show less.

    Args:
        trials: recorded trials.
        model: nominal model; what it predicts says what should move.

    Returns:
        each trial; a note per channel.
    """
    runs = [
        {
            column: found
            for column in range(len(model.channels))
            if (found := _runs(trial.observed[:, column]))
        }
        for trial in trials
    ]
    paths = {
        number: model.simulate([trial], [()])[0][0]
        for number, trial in enumerate(trials)
        if runs[number]
    }
    explained: set[str] = set()
    for number, predicted in paths.items():
        explained |= model.at_rest(trials[number], predicted)
    return [
        _without(trial, model, runs[number], paths[number], explained)
        if runs[number]
        else (trial, [])
        for number, trial in enumerate(trials)
    ]


def _without(
    trial: Trial,
    model: GapModel,
    runs: Mapping[int, Sequence[tuple[int, int]]],
    predicted: np.ndarray,
    explained: Collection[str],
) -> tuple[Trial, list[str]]:
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
            seen, due = trial.observed[:, column], predicted[:, column]
            if _rested(seen, due, first, last, least):
                continue
            name, unit = model.channels[column].name, model.channels[column].unit
            observed[first : last + 1] = np.nan
            seconds = trial.times[last] - trial.times[first]
            notes.append(
                f"{name} is stuck for {seconds:.3g} s, in which it should have moved "
                f"by {moved:.2g} {unit}; these samples dropped"
            )
    return (trial.replace(observed=observed) if notes else trial), notes


def _rested(
    seen: np.ndarray, predicted: np.ndarray, first: int, last: int, least: float
) -> bool:
    """Whether a channel rested, or was held, and is not stuck.

    It goes on from the value that it kept: by less than `CAUGHT_UP` of what it should
    have moved by then, beyond what it should move in that sample. A channel that was
    stuck jumps; a part in its play, or held by friction, does not. Or it stays to the
    end, and should not have moved as it came to rest.

    Args:
        seen: recorded, ``(T,)``.
        predicted: the same by the nominal model.
        first, last: samples between which it kept one value.
        least: motion that would have shown.
    """
    after = last + 1 + np.flatnonzero(np.isfinite(seen[last + 1 :]))
    if not len(after):
        return bool(np.ptp(predicted[first : first + RUN]) < least)
    due = abs(predicted[after[0]] - predicted[first])
    step = abs(predicted[after[0]] - predicted[last])
    return bool(abs(seen[after[0]] - seen[last]) < CAUGHT_UP * due + step)


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
