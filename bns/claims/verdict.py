"""The rule that turns a comparison into a verdict. Direction and significance apart.

Share: probability that a run of side a is better (or has more, where the measure is
neither good nor bad) than one of side b: A12, ties counted half. For a side held
against a number it is the share of runs on the claimed side of it.

Of a claimed difference
    holds           the share is on the claimed side of one half, and p < 0.05
    direction only  it is on that side, p >= 0.05
    null            it is on the other side or on none, p >= 0.05
    reversed        it is on the other side, and p < 0.05
Of a claimed "no difference"
    holds           p >= 0.05, and the 95 % interval of the share lies within
                    0.353 to 0.647: equivalent
    null            p >= 0.05, the interval is wider: not refuted, not shown either
    reversed        p < 0.05: there is a difference
Of a claimed difference without a direction
    holds           p < 0.05
    null            else

A claim of several comparisons has the least favourable verdict of those that are of its
kind: of the differences where it claims a difference with a p value, of the others
where it claims none; else of all. Each comparison has its own verdict beside it.

p is two-sided and unadjusted, as in the dissertation; Holm's p over all comparisons
stands beside it. A comparison rests on 100 runs a side where the dissertation's p lies
between 0.001 and 0.06 or may lie there, else on 30; with fewer it is provisional.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats as scipy_stats

from bns import stats
from bns.claims import measures
from bns.claims.claim import Cell
from bns.experiment.record import RunRecord
from bns.stats import Interval
from bns.stats.power import power

LEVEL = 0.05
MARGIN = 0.147
"""equivalence: what an A12 of 30 runs a side can just be told from one half by"""

FEW, MANY = 30, 100
NEAR = (0.001, 0.06)
ORDER = ("reversed", "null", "direction only", "holds")
"""verdicts, least favourable first"""


@dataclass(frozen=True)
class Finding:
    """What runs say of a cell.

    Attributes:
        cell: what was compared.
        runs: on each side.
        wanted: runs a side that the rule asks for.
        p: two-sided; Mann-Whitney, or the sign test against a number.
        p_holm: adjusted over all cells of a table; 1.0 before that is done.
        share: of pairs that a wins, with its 95 % interval.
        power: chance to find an effect of this size with these runs.
        verdict: one of `ORDER`.
        published: whether it came with the package, and not from runs at hand.
    """

    cell: Cell
    runs: tuple[int, ...]
    wanted: int
    p: float
    share: Interval
    power: float
    verdict: str
    p_holm: float = 1.0
    published: bool = False

    @property
    def provisional(self) -> bool:
        """Whether it rests on fewer runs than the rule asks for."""
        return min(self.runs) < self.wanted


def runs_wanted(cell: Cell) -> int:
    """Runs a side that the rule asks for."""
    if cell.p in ("-", "n.s."):
        return FEW
    number = float(re.sub(r"[<>=]", "", cell.p))
    if cell.p.startswith("<"):
        return MANY if number > NEAR[0] else FEW
    return MANY if NEAR[0] <= number <= NEAR[1] else FEW


def judge(cell: Cell, a: RunRecord, b: RunRecord | None) -> Finding | None:
    """The finding of a cell; None where runs lack what is measured.

    Args:
        cell: what is compared.
        a: runs of its first side.
        b: runs of its second, None for a number.

    Raises:
        BnsError: a column is missing.
    """
    mine = measures.of(a, cell.measure)
    if len(mine) == 0:
        return None
    if b is None:
        return _against_number(cell, mine)
    other = measures.of(b, cell.measure_b or cell.measure)
    if len(other) == 0:
        return None
    low = measures.measure(cell.measure).low
    share = stats.a12(other, mine) if low else stats.a12(mine, other)
    p = stats.mann_whitney(mine, other)
    return finding(cell, (len(mine), len(other)), p, share)


def finding(cell: Cell, runs: tuple[int, ...], p: float, share: Interval) -> Finding:
    """The finding of a cell from its statistics.

    Args:
        cell: what is compared.
        runs: on each side, or on the one that is held against a number.
        p: two-sided.
        share: of pairs, or of runs, with its interval.
    """
    against_number = len(runs) == 1
    chance = (_sign_power if against_number else power)(share.value, *runs)
    said = verdict(">" if against_number else cell.says, share, p)
    return Finding(cell, runs, runs_wanted(cell), p, share, chance, said)


def verdict(says: str, share: Interval, p: float) -> str:
    """The verdict of one comparison by the rule above."""
    if says == "=":
        inside = share.low >= 0.5 - MARGIN and share.high <= 0.5 + MARGIN
        return "reversed" if p < LEVEL else "holds" if inside else "null"
    if says == "?":
        return "holds" if p < LEVEL else "null"
    value = share.value if says == ">" else 1 - share.value
    if p < LEVEL:
        return "holds" if value > 0.5 else "reversed"
    return "direction only" if value > 0.5 else "null"


def of_claim(kind: str, findings: Iterable[Finding]) -> str:
    """The verdict of a claim from those of its comparisons, by the rule above."""
    found = list(findings)
    if kind in ("S", "N"):
        own = [each for each in found if (each.cell.says == "=") == (kind == "N")]
        found = own or found
    return min((each.verdict for each in found), key=ORDER.index)


def adjusted(findings: list[Finding]) -> list[Finding]:
    """The findings with Holm's p over all of them."""
    p = stats.holm([finding.p for finding in findings])
    return [
        replace(finding, p_holm=float(value))
        for finding, value in zip(findings, p, strict=True)
    ]


def _against_number(cell: Cell, values: np.ndarray) -> Finding:
    """How many runs are on the claimed side; sign test against one half."""
    if cell.at_most is not None:
        count = int((values <= cell.at_most).sum())
    else:
        count = int((values >= cell.at_least).sum())
    test = scipy_stats.binomtest(count, len(values), 0.5)
    limits = test.proportion_ci(stats.CONFIDENCE, method="wilson")
    share = Interval(count / len(values), float(limits.low), float(limits.high))
    return finding(cell, (len(values),), float(test.pvalue), share)


def _sign_power(share: float, runs: int) -> float:
    """Probability that the sign test finds a share."""
    counts = np.arange(runs + 1)
    found = [scipy_stats.binomtest(int(k), runs, 0.5).pvalue < LEVEL for k in counts]
    return float(scipy_stats.binom.pmf(counts[found], runs, share).sum())
