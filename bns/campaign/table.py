"""What a campaign says: medians of its members, and pairs of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from bns import stats
from bns.campaign.file import Member
from bns.campaign.results import Results
from bns.errors import BnsError
from bns.experiment.validate import leaves
from bns.stats import Interval
from bns.stats.compare import unequal, values
from bns.stats.designs import power
from bns.stats.measures import bootstrap_median

MOST_PAIRS = 500


@dataclass(frozen=True)
class Row:
    """One member on one measure.

    Attributes:
        label: of the member.
        runs: replicates that have a value.
        reached: those that got there.
        median: with its bootstrap interval; infinite = never.
    """

    label: str
    runs: int
    reached: int
    median: Interval


@dataclass(frozen=True)
class Versus:
    """Two members on one measure.

    Attributes:
        a, b: labels.
        p: two-sided Mann-Whitney.
        p_holm: adjusted for all pairs of the table.
        a12: probability that a value of `a` is larger than one of `b`.
        power: chance to find an effect of the observed size with these runs.
    """

    a: str
    b: str
    p: float
    p_holm: float
    a12: Interval
    power: float


@dataclass(frozen=True)
class Table:
    """A campaign on one measure.

    Attributes:
        measure: one of `bns.stats.compare.MEASURES`.
        rows: members that have a value.
        pairs: pairs of them.
        notes: what keeps figures from being comparable, a sentence each.
    """

    measure: str
    rows: tuple[Row, ...]
    pairs: tuple[Versus, ...]
    notes: tuple[str, ...] = ()


def table(found: Results, measure: str = "observation") -> Table:
    """The members that have runs, and those pairs of them that tell something.

    Pairs are of members that differ in one setting, or all where none do; of a sample
    none are made.

    Raises:
        BnsError: no runs yet, or no member has the measure.
    """
    have = [
        (member, sample)
        for member in found.campaign.members
        if (record := found.of(member)) is not None
        and len(sample := values(record, measure))
    ]
    if not have:
        raise BnsError(_nothing(found, measure))
    rows = [
        Row(m.label, len(s), int(np.isfinite(s).sum()), bootstrap_median(s))
        for m, s in have
    ]
    pairs = tuple(_pairs(have, found.campaign.sampled))
    names = [member.label for member, _ in have]
    records = [found.records[member.identity] for member, _ in have]
    return Table(measure, tuple(rows), pairs, tuple(unequal(names, records, measure)))


def _nothing(found: Results, measure: str) -> str:
    """Why no member has a value, and what to do."""
    where = found.store.directory
    done = [r for m in found.campaign.members if (r := found.of(m)) is not None]
    if not done:
        return (
            f"{where} has nothing on {measure!r} yet, since no runs are done: see "
            f"`bns campaign status {where}`."
        )
    first = min(int(record.damage_onset.min()) for record in done)
    trials = max(record.trials for record in done)
    why = "nothing is damaged in it"
    if first >= 0:
        why = f"damage comes at trial {first}, counted from 0, and runs have {trials}"
    return (
        f"{where} has nothing on {measure!r}, which counts from the damage on: {why}. "
        "Give --measure solve, or run more trials."
    )


def differing(one: Member, other: Member) -> list[str]:
    """Settings in which two members differ."""
    theirs = dict(leaves(other.config))
    return [name for name, value in leaves(one.config) if value != theirs[name]]


def _pairs(have: Sequence[tuple[Member, np.ndarray]], sampled: bool) -> list[Versus]:
    if sampled:
        return []
    pairs = list(combinations(have, 2))
    near = [(a, b) for a, b in pairs if len(differing(a[0], b[0])) == 1]
    near = (near or pairs)[:MOST_PAIRS]
    p = [stats.mann_whitney(a[1], b[1]) for a, b in near]
    adjusted = stats.holm(p)
    found = []
    for (a, b), raw, holm in zip(near, p, adjusted, strict=True):
        effect = stats.a12(a[1], b[1])
        chance = power(effect.value, len(a[1]), len(b[1]))
        found.append(Versus(a[0].label, b[0].label, raw, float(holm), effect, chance))
    return found
