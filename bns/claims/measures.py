"""What is measured of each run of a record, one number per run.

Trials are counted from 0, "the damage" is its first trial. Costs are those of the best
of the population (`fitness_best`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from bns import stats
from bns.errors import BnsError, UnknownNameError
from bns.experiment.record import RunRecord

Values = Callable[[RunRecord], np.ndarray]
LAST = 10  # trials
COST, SNN, SENSOR = "fitness_best", "snn_forward", "sensor_left"


@dataclass(frozen=True)
class Measure:
    """A number per run.

    Attributes:
        doc: what it is.
        values: of the runs of a record, ``(R,)``; NaN = none.
        low: whether less of it is better; of what is neither good nor bad, a claim
            says "more", and low is False.
    """

    doc: str
    values: Values
    low: bool = True


def measure(name: str) -> Measure:
    """The measure called `name`.

    Raises:
        UnknownNameError: there is none.
    """
    if name not in MEASURES:
        raise UnknownNameError("measure", name, MEASURES)
    return MEASURES[name]


def of(record: RunRecord, name: str) -> np.ndarray:
    """A measure of every run.

    Args:
        record: R runs.
        name: of the measure.

    Returns:
        ``(R,)`` in the measure's unit; NaN where a run has no value.

    Raises:
        BnsError: the runs lack a column that it needs.
    """
    try:
        return measure(name).values(record)
    except KeyError as error:
        raise BnsError(f"These runs have no {error}, which {name!r} needs.") from error


def _onset(record: RunRecord) -> int:
    return int(record.damage_onset[0])


def _over(column: str, first: Callable[[RunRecord], int], count: int) -> Values:
    """Mean of a column over `count` trials from `first` on."""

    def values(record: RunRecord) -> np.ndarray:
        """The measure of each run, ``(R,)``."""
        start = first(record)
        found = record[column][:, max(0, start) : max(0, start + count)]
        if found.shape[1] == 0 or (start != 0 and _onset(record) < 0):
            return np.full(record.replicates, np.nan)
        return found.mean(axis=1)

    return values


def _end(column: str) -> Values:
    """Mean of a column over the last trials."""
    return lambda record: record[column][:, -LAST:].mean(axis=1)


def _before(record: RunRecord) -> np.ndarray:
    return record[COST][:, : max(0, _onset(record))].sum(axis=1)


def _first_20(record: RunRecord) -> np.ndarray:
    return record[COST][:, :20].sum(axis=1)


def _within(limit: int) -> Values:
    """Trials to recover, infinite beyond a limit that all records share."""

    def values(record: RunRecord) -> np.ndarray:
        """The measure of each run, ``(R,)``."""
        found = stats.trials_to_recover(record)
        return np.where(found > limit, np.inf, found)

    return values


def _dip(every: int) -> Values:
    """Rise of the cost over resets that come every so many trials."""

    def values(record: RunRecord) -> np.ndarray:
        """The measure of each run, ``(R,)``."""
        resets = np.arange(every, record.trials, every)
        cost = record[COST]
        return (cost[:, resets] - cost[:, resets - 1]).mean(axis=1)

    return values


def _peak(record: RunRecord) -> np.ndarray:
    """Cost around the worst trial after the damage, as others of the batch place it.

    Smoothed over five trials. To place it by the run's own cost would pick its noise,
    and find an improvement in any run that does not change.
    """
    start = _onset(record)
    smooth = np.stack(
        [np.convolve(cost[start:], np.ones(5) / 5, "valid") for cost in record[COST]]
    )
    if len(smooth) == 1:
        return smooth.max(axis=1)
    others = (smooth.sum(axis=0) - smooth) / (len(smooth) - 1)
    return np.take_along_axis(smooth, others.argmax(axis=1)[:, None], 1)[:, 0]


def _one_handed(record: RunRecord) -> np.ndarray:
    """How alike the last trials turn: 1 = all one way, 0 = half each way."""
    return np.abs(np.sign(record["turned"][:, -LAST:]).mean(axis=1))


def _regained(share: float, before: Callable[..., np.ndarray]) -> Values:
    """Trials from the damage until the robot gets a share as far as before it."""

    def values(record: RunRecord) -> np.ndarray:
        """The measure of each run, ``(R,)``."""
        start, ways = _onset(record), record["distance"]
        enough = share * before(ways[:, :start], axis=1)
        there = ways[:, start:] >= enough[:, None]
        return np.where(there.any(axis=1), there.argmax(axis=1) + 1.0, np.inf)

    return values


def _usual(ways: np.ndarray, axis: int) -> np.ndarray:
    """The median of the last ten trials."""
    return np.median(ways[:, -LAST:], axis=axis)


def onset_of_improvement(record: RunRecord) -> np.ndarray:
    """First trial at which the cost has made up a fifth of its rise; inf = never.

    The cost is smoothed over five trials; the rise is from its mean over the ten
    trials before the damage to its peak after.

    Returns:
        ``(R,)``, counted from 0.
    """
    start = _onset(record)
    found = np.full(record.replicates, np.inf)
    for run, cost in enumerate(record[COST]):
        before = cost[max(0, start - LAST) : start].mean()
        smooth = np.convolve(cost[start:], np.ones(5) / 5, mode="valid")
        peak = int(smooth.argmax())
        low = smooth[peak:] <= smooth[peak] - 0.2 * (smooth[peak] - before)
        if smooth[peak] > before and low.any():
            found[run] = start + peak + int(low.argmax())
    return found


def _diversity(equation: str) -> dict[str, Measure]:
    """Diversity by one equation, at several times."""
    column, short = f"diversity_{equation}", f"diversity{equation}"
    times = {
        "start": ("first ten trials", _over(column, lambda r: 0, LAST)),
        "before": (
            "ten trials before the damage",
            _over(column, lambda r: _onset(r) - LAST, LAST),
        ),
        "next": (
            "trial after the first damaged one",
            _over(column, lambda r: _onset(r) + 1, 1),
        ),
        "end": ("last ten trials", _end(column)),
        "mean": ("all trials, per individual", _per_individual(column)),
    }
    return {
        f"{short}-{time}": Measure(f"diversity {equation}, {doc}", values, low=False)
        for time, (doc, values) in times.items()
    }


def _per_individual(column: str) -> Values:
    return lambda r: r[column].mean(axis=1) / r.config.evolution.population


MEASURES: Mapping[str, Measure] = {
    "observation": Measure(
        "cost summed from the damage on (eq 3.1)", stats.observation_after
    ),
    "solve": Measure("trials until solved, counted from 1", stats.trials_to_solve),
    "recover": Measure(
        "trials from the damage until solved again, counted from 1",
        stats.trials_to_recover,
    ),
    "within-50": Measure("trials to recover, never if more than 50", _within(50)),
    "before": Measure("cost summed over the trials before the damage", _before),
    "before-10": Measure(
        "cost, ten trials before the damage",
        _over(COST, lambda r: _onset(r) - LAST, LAST),
    ),
    "after": Measure("cost, ten trials from the damage on", _over(COST, _onset, LAST)),
    "next": Measure(
        "cost, trial after the first damaged one",
        _over(COST, lambda r: _onset(r) + 1, 1),
    ),
    "end": Measure("cost, last ten trials", _end(COST)),
    "first-20": Measure("cost summed over the first 20 trials", _first_20),
    "dip-10": Measure("rise of the cost over resets every 10 trials", _dip(10)),
    "onset-of-improvement": Measure(
        "first trial at which a fifth of the rise is made up", onset_of_improvement
    ),
    "snn-before": Measure(
        "error of the forward motion, five trials before the damage",
        _over(SNN, lambda r: _onset(r) - 5, 5),
    ),
    "snn-onset": Measure(
        "error of the forward motion, first damaged trial", _over(SNN, _onset, 1)
    ),
    "snn-end": Measure("error of the forward motion, last ten trials", _end(SNN)),
    "snn-first": Measure(
        "error of the forward motion, first trial", _over(SNN, lambda r: 0, 1)
    ),
    "sensor-first": Measure(
        "error of the left sensor, first trial", _over(SENSOR, lambda r: 0, 1)
    ),
    "sensor-end": Measure("error of the left sensor, last ten trials", _end(SENSOR)),
    "peak": Measure("cost around the worst trial after the damage", _peak),
    "one-handed": Measure(
        "how alike the last ten trials turn, 0 to 1", _one_handed, low=False
    ),
    "regain": Measure(
        "trials from the damage until 90 % as far as in the ten before it",
        _regained(0.9, _usual),
    ),
    "surpass": Measure(
        "trials from the damage until farther than ever before",
        _regained(1.0, np.max),
    ),
    **_diversity("41"),
    **_diversity("51"),
    **_diversity("73"),
}
