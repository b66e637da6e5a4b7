"""What the runs of the standings say: trials to a bar, shares of the ceiling, wins."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from bns import stats
from bns.campaign.results import records
from bns.campaign.store import CampaignStore
from bns.errors import BnsError
from bns.experiment.record import RunRecord
from bns.standings.design import DESIGNS, Entry

LEVEL = 0.05
"""p (Holm) below which a difference counts as won or lost"""
FEWEST = 4
"""runs that differ, on both sides, below which nothing counts as won or lost: an exact
test of three against three cannot find a difference"""
SHARES = (0.5, 0.75)
"""of the ceiling, beside the task's own bar"""


@dataclass(frozen=True, eq=False)
class Cell:
    """The runs of one learner with one prior on one damage, from the damage on.

    Attributes:
        entry: which.
        deployed: what the controller deployed achieves, ``(R, T)``: metres walked, or 1
            where the task is done.
        tried: the same of the one that is tried.
        bar: from which on the task is done.
        ceiling: farthest that is known to be possible; NaN = not known.
        harmed: trials in which the robot fell, strained a servo or was stopped at a
            lamp, ``(R,)``.
        evaluations: of the model, at the end, ``(R,)``.
    """

    entry: Entry
    deployed: np.ndarray
    tried: np.ndarray
    bar: float
    ceiling: float
    harmed: np.ndarray
    evaluations: np.ndarray

    @property
    def runs(self) -> int:
        """How many there are."""
        return len(self.deployed)

    @property
    def distinct(self) -> int:
        """How many of them differ: where nothing is left to chance all are alike."""
        return len(np.unique(self.deployed, axis=0))

    def waits(self, bar: float) -> np.ndarray:
        """Trials with the damage until the one deployed achieved `bar`, ``(R,)``.

        The first damaged trial is 1; inf = never, NaN where the bar is not known.
        """
        if np.isnan(bar):
            return np.full(self.runs, np.nan)
        hit = self.deployed >= bar
        return np.where(hit.any(1), hit.argmax(1) + 1.0, np.inf)


def read(entries: Sequence[Entry], root: Path) -> list[Cell]:
    """The cells that have runs.

    Args:
        entries: that are wanted.
        root: directory of the store.

    Raises:
        BnsError: none has.
    """
    if not (root / "campaign.json").exists():
        raise BnsError(f"{root} holds no standings yet: run `bns standings run`.")
    wanted = {entry.member.identity for entry in entries}
    found = records(CampaignStore.open(root), wanted)
    cells = [
        cell(entry, found[entry.member.identity])
        for entry in entries
        if entry.member.identity in found
    ]
    if not cells:
        raise BnsError(
            f"{root} holds none of these cells yet: run `bns standings run`."
        )
    return cells


def cell(entry: Entry, record: RunRecord) -> Cell:
    """What a record says from its damage on."""
    onset = int(record.damage_onset[0])
    design = DESIGNS[entry.task]
    if entry.task == "walk":
        best, seen = (
            np.sqrt(np.maximum(-record[name], 0.0)) / 100.0
            for name in ("fitness_best", "fitness")
        )
        bar = record.config.walk.adequate
    else:
        seen, bar = record["solved"], 1.0
        best = record.columns.get("solved_best", seen)
    flags = [record.columns[n] for n in HARM if n in record.columns]
    harmed = np.sum([flag[:, onset:] > 0 for flag in flags], axis=0) > 0
    spent = record.columns.get("evaluations")
    return Cell(
        entry=entry,
        deployed=best[:, onset:],
        tried=seen[:, onset:],
        bar=bar,
        ceiling=design.ceilings.get(entry.damage, np.nan),
        harmed=harmed.sum(1) if flags else np.zeros(len(seen)),
        evaluations=np.zeros(len(seen)) if spent is None else spent[:, -1],
    )


HARM = ("fell", "overloaded", "overheated", "lamp_stops")


@dataclass(frozen=True)
class Row:
    """A learner over all damages of a set.

    Attributes:
        rival: by name.
        runs: least of a damage, how many damages, and least of runs that differ.
        waits: bar by name -> median of trials and its exact interval, and how many of
            how many runs never got there.
        deployed, tried, last: mean of what `measure` says: of the one deployed and the
            one tried over all trials, and deployed in the last five; NaN where no
            ceiling is known.
        harmed: share of trials that did harm.
        evaluations: of the model, median.
    """

    rival: str
    runs: tuple[int, int, int]
    waits: Mapping[str, tuple[stats.Interval, int, int]]
    deployed: float
    tried: float
    last: float
    harmed: float
    evaluations: float


def measure(task: str, kind: str) -> str:
    """What the means of a task and a set of damages are of, in words."""
    design = DESIGNS[task]
    if not design.ceilings:
        return "share solved"
    known = set(design.damages[kind]) & set(design.ceilings)
    return "share of the ceiling" if known else "distance [m]"


def comparable(cells: Sequence[Cell]) -> list[tuple[Cell, float]]:
    """Cells of one task and set whose means can be taken together, each with what it
    is divided by: where shares of the ceiling are meant, those whose ceiling is known.
    """
    entry = cells[0].entry
    if measure(entry.task, entry.kind) != "share of the ceiling":
        return [(cell, 1.0) for cell in cells]
    return [(cell, cell.ceiling) for cell in cells if np.isfinite(cell.ceiling)]


def _mean(shares: Sequence[float]) -> float:
    return float(np.mean(shares)) if shares else float("nan")


def row(rival: str, cells: Sequence[Cell]) -> Row:
    """The figures of a learner's cells of one task, prior and set."""
    bars = {"the task": [c.waits(c.bar) for c in cells]}
    if any(np.isfinite(c.ceiling) for c in cells):
        for share in SHARES:
            name = f"{share:.0%} of the ceiling"
            bars[name] = [c.waits(share * c.ceiling) for c in cells]
    waits = {}
    for name, each in bars.items():
        pooled = np.concatenate(each)
        pooled = pooled[~np.isnan(pooled)]
        middle = stats.median_interval(pooled)
        waits[name] = (middle, int(np.isinf(pooled).sum()), len(pooled))
    known = comparable(cells)
    trials = sum(c.tried.size for c in cells)
    return Row(
        rival,
        (
            min(c.runs for c in cells),
            len(cells),
            min(c.distinct for c in cells),
        ),
        waits,
        _mean([c.deployed.mean() / top for c, top in known]),
        _mean([c.tried.mean() / top for c, top in known]),
        _mean([c.deployed[:, -5:].mean() / top for c, top in known]),
        float(sum(c.harmed.sum() for c in cells) / trials),
        float(np.median(np.concatenate([c.evaluations for c in cells]))),
    )


@dataclass(frozen=True)
class Match:
    """Two learners on the same damages, by what is deployed over all trials.

    Attributes:
        a, b: rivals.
        won, tied, lost: damages, as `a` sees them; p by Mann-Whitney and Holm.
        better: share of pairs of runs in which `a` achieves more, mean over damages.
    """

    a: str
    b: str
    won: int
    tied: int
    lost: int
    better: float


def matches(cells: Sequence[Cell]) -> list[Match]:
    """All pairs of learners in cells of one task, prior and set."""
    known = {(c.entry.rival, c.entry.damage): c for c in cells}
    held: dict[tuple[str, str], np.ndarray] = {
        key: c.deployed.mean(1) for key, c in known.items()
    }
    names = list(dict.fromkeys(c.entry.rival for c in cells))
    pairs = [
        (a, b, damage)
        for a, b in combinations(names, 2)
        for damage in dict.fromkeys(c.entry.damage for c in cells)
        if (a, damage) in held and (b, damage) in held
    ]
    samples = [(held[a, damage], held[b, damage]) for a, b, damage in pairs]
    enough = [
        min(known[a, d].distinct, known[b, d].distinct) >= FEWEST for a, b, d in pairs
    ]
    raw = [
        stats.mann_whitney(*both) if some else 1.0
        for both, some in zip(samples, enough, strict=True)
    ]
    p: Sequence[float] | np.ndarray = stats.holm(raw) if pairs else []
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for (a, b, _), value, both in zip(pairs, p, samples, strict=True):
        found.setdefault((a, b), []).append((float(value), stats.a12_value(*both)))
    return [
        Match(
            a,
            b,
            sum(value < LEVEL and share > 0.5 for value, share in each),
            sum(not (value < LEVEL and share != 0.5) for value, share in each),
            sum(value < LEVEL and share < 0.5 for value, share in each),
            float(np.mean([share for _, share in each])),
        )
        for (a, b), each in found.items()
    ]


def groups(cells: Sequence[Cell]) -> dict[tuple[str, str, str], list[Cell]]:
    """Cells by task, prior and set of damages, in that order."""
    found: dict[tuple[str, str, str], list[Cell]] = {}
    for each in cells:
        key = (each.entry.task, each.entry.prior, each.entry.kind)
        found.setdefault(key, []).append(each)
    return found


def by_rival(cells: Sequence[Cell]) -> dict[str, list[Cell]]:
    """Cells by learner."""
    found: dict[str, list[Cell]] = {}
    for each in cells:
        found.setdefault(each.entry.rival, []).append(each)
    return found
