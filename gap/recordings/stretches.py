"""Parts of trials: a piece between two samples, and a share of long recordings."""

from collections.abc import Sequence

import numpy as np

from bns.worlds.trial import Commands, Trial

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0  # spreads the stretches over their trials
SHORTEST = 8.0  # [s] of a trial below which nothing is left out of it


def piece(trial: Trial, first: int, last: int) -> Trial:
    """Samples first to last of a trial, and the commands between them.

    Args:
        trial: recorded.
        first, last: numbers of its samples; both are kept.
    """
    bounds = trial.boundaries
    inner = bounds[(bounds > first) & (bounds < last)]
    marks = np.concatenate([[first], inner, [last]])
    index = np.clip(
        np.searchsorted(bounds, marks[:-1], side="right") - 1, 0, len(bounds) - 2
    )
    lasting = np.diff(trial.times[marks])
    told = Commands(trial.commands.values[index], lasting, trial.commands.channels)
    return trial.replace(
        commands=told,
        times=trial.times[first : last + 1] - trial.times[first],
        observed=trial.observed[first : last + 1],
        boundaries=marks - first,
        handled=np.zeros(0, bool),
        truth={},
    )


def shortened(
    trials: Sequence[Trial], most: float, before: float
) -> list[tuple[Trial, float]]:
    """A recording cut to so many seconds, the same share of each trial.

    Of each long trial one stretch is kept, in turn near its begin and near its end, so
    that all of a drive is seen in some trial.

    Args:
        trials: recorded.
        most: seconds that are kept of all trials together.
        before: seconds before a stretch that are kept as well: until a robot that is
            simulated from rest moves as it did.

    Returns:
        each trial, and the time until which nothing of it counts [s].
    """
    spans = [float(trial.times[-1] - trial.times[0]) for trial in trials]
    total = sum(spans)
    if total <= most:
        return [(trial, 0.0) for trial in trials]
    made = []
    for number, (trial, span) in enumerate(zip(trials, spans, strict=True)):
        length = max(SHORTEST, span * most / total)
        if length + before >= span:
            made.append((trial, 0.0))
            continue
        begin = trial.times[0] + (span - length) * ((number * GOLDEN) % 1.0)
        first = int(np.searchsorted(trial.times, begin - before))
        last = min(
            int(np.searchsorted(trial.times, begin + length)), len(trial.times) - 1
        )
        begun = 0.0 if first == 0 else before
        made.append((piece(trial, first, last), begun))
    return made
