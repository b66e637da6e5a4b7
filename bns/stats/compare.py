"""Runs against each other: medians, p values, effect sizes, milestones."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bns import stats
from bns.errors import BnsError
from bns.experiment.record import RunRecord
from bns.progress import Each, uncounted
from bns.stats import Interval

MEASURES = {
    "observation": "cost after the onset of damage (eq 3.1), lower is better",
    "solve": "trials until solved, counted from 1",
    "recover": "trials from the onset of damage until solved again, counted from 1",
}
"""what is compared, and what it means"""

UNEQUAL = {
    "observation": "the cost is summed over more trials in some runs than in others",
    "solve": "a run that solves later than its last trial counts as never",
    "recover": "a run that recovers later than its last trial counts as never",
}
"""what it means that runs are compared over different numbers of trials"""
A12 = "A12: probability that a's value is larger than b's, ties counted half"
NAMED = 6  # runs that a note names


@dataclass(frozen=True)
class Side:
    """One run on one measure.

    Attributes:
        name: of the run.
        measure: one of `MEASURES`.
        runs: replicates that have a value.
        reached: replicates that got there (all, for the observation).
        median: with its interval; infinite = never.
    """

    name: str
    measure: str
    runs: int
    reached: int
    median: Interval


@dataclass(frozen=True)
class Pair:
    """Two runs on one measure.

    Attributes:
        a, b: names of the runs.
        measure: one of `MEASURES`.
        p: two-sided Mann-Whitney, as the dissertation computes it.
        p_holm: adjusted for all pairs of this measure.
        a12: probability that a value of `a` is larger than one of `b`.
    """

    a: str
    b: str
    measure: str
    p: float
    p_holm: float
    a12: Interval


@dataclass(frozen=True)
class Comparison:
    """All runs and all pairs of them.

    Attributes:
        sides: runs on every measure.
        pairs: pairs of runs on every measure.
        notes: what keeps figures from being comparable, a sentence each.
    """

    sides: tuple[Side, ...]
    pairs: tuple[Pair, ...]
    notes: tuple[str, ...] = ()

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON (infinity as null, intervals as tables)."""
        return {
            "measures": MEASURES,
            "runs": [
                _plain(asdict(side), side.median, "median") for side in self.sides
            ],
            "notes": list(self.notes),
            "pairs": [_plain(asdict(pair), pair.a12, "a12") for pair in self.pairs],
        }


def compare(
    records: Sequence[RunRecord], names: Sequence[str] = (), each: Each = uncounted
) -> Comparison:
    """Compare two or more runs on every measure that all of them have.

    Args:
        records: finished runs.
        names: of the runs; by default those of their directories.
        each: goes through the measures, and may count them.

    Raises:
        BnsError: fewer than two runs, or one that is not finished.
    """
    if len(records) < 2:
        given = "1 run was" if records else "0 runs were"
        raise BnsError(f"{given} given: give two or more to compare.")
    names = list(names) or labels(records)
    for name, record in zip(names, records, strict=True):
        if record.trials < record.config.trials:
            raise BnsError(
                f"{name} has done {record.trials} of {record.config.trials} trials: "
                f"finish it with `bns run {record.directory or name} --resume`."
            )
    sides: list[Side] = []
    pairs: list[Pair] = []
    notes: list[str] = []
    for measure in each(tuple(MEASURES)):
        samples = [values(record, measure) for record in records]
        if all(len(sample) for sample in samples):
            sides += [side(n, measure, s) for n, s in zip(names, samples, strict=True)]
            pairs += _pairs(names, samples, measure)
            notes += unequal(names, records, measure)
    return Comparison(tuple(sides), tuple(pairs), tuple(notes))


def unequal(
    names: Sequence[str], records: Sequence[RunRecord], measure: str
) -> list[str]:
    """A sentence where a measure looks at more trials of some runs than of others.

    Args:
        names: of the runs.
        records: the runs.
        measure: one of `MEASURES`.
    """
    looked = [trials_of(record, measure) for record in records]
    if len(set(looked)) < 2:
        return []
    named = [f"{n} {text}" for n, text in zip(names[:NAMED], looked, strict=False)]
    more = len(names) - len(named)
    listed = ", ".join([*named, f"and {more} more"] if more > 0 else named)
    return [f"{measure} looks at unequal numbers of trials ({listed}): "
            f"{UNEQUAL[measure]}."]  # fmt: skip


def trials_of(record: RunRecord, measure: str) -> str:
    """How many trials of its runs a measure looks at: "30", or "10 to 30"."""
    first = np.maximum(record.damage_onset, 0) * (measure != "solve")
    left = record.trials - first[first < record.trials]
    if not len(left):
        return "0"
    least, most = int(left.min()), int(left.max())
    return f"{least}" if least == most else f"{least} to {most}"


def values(record: RunRecord, measure: str) -> np.ndarray:
    """One number per replicate, without those that have none.

    Args:
        record: R finished runs.
        measure: "observation", "solve" or "recover".

    Returns:
        ``(n,)``, n <= R: cost, or trials (inf = never).
    """
    found = {
        "observation": stats.observation_after,
        "solve": stats.trials_to_solve,
        "recover": stats.trials_to_recover,
    }[measure](record)
    return found[~np.isnan(found)]


def side(name: str, measure: str, sample: np.ndarray) -> Side:
    """One run on one measure.

    Args:
        name: of the run.
        measure: one of `MEASURES`.
        sample: its values, ``(n,)``; infinite = never.
    """
    reached = int(np.isfinite(sample).sum())
    return Side(name, measure, len(sample), reached, stats.median_interval(sample))


def labels(records: Sequence[RunRecord]) -> list[str]:
    """Short names that tell the runs apart: the ends of their directories."""
    paths = [Path(record.directory or f"run {i}") for i, record in enumerate(records)]
    for length in range(1, max(len(path.parts) for path in paths) + 1):
        short = ["/".join(path.parts[-length:]) for path in paths]
        if len(set(short)) == len(short):
            return short
    return [f"{path} ({i + 1})" for i, path in enumerate(paths)]


def _pairs(
    names: Sequence[str], samples: Sequence[np.ndarray], measure: str
) -> list[Pair]:
    index = [(i, j) for i in range(len(names)) for j in range(i + 1, len(names))]
    p = [stats.mann_whitney(samples[i], samples[j]) for i, j in index]
    adjusted = stats.holm(p)
    return [
        Pair(
            names[i],
            names[j],
            measure,
            p[k],
            float(adjusted[k]),
            stats.a12(samples[i], samples[j]),
        )
        for k, (i, j) in enumerate(index)
    ]


def _plain(content: dict[str, Any], interval: Interval, key: str) -> dict[str, Any]:
    finite = [float(x) if np.isfinite(x) else None for x in interval]
    return content | {key: dict(zip(Interval._fields, finite, strict=True))}
