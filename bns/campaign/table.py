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
from bns.stats.compare import values
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
    """A campaign on one measure."""

    measure: str
    rows: tuple[Row, ...]
    pairs: tuple[Versus, ...]


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
        raise BnsError(
            f"{found.store.directory} has nothing on {measure!r} yet: see "
            f"`bns campaign status {found.store.directory}`."
        )
    rows = [
        Row(m.label, len(s), int(np.isfinite(s).sum()), bootstrap_median(s))
        for m, s in have
    ]
    return Table(measure, tuple(rows), tuple(_pairs(have, found.campaign.sampled)))


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
