"""The rule that turns a comparison into a verdict. Direction and significance apart.

Share: probability that a run of side a is better (or has more, where the measure is
neither good nor bad) than one of side b: A12, ties counted half. For a side held
against a number it is the share of runs on the claimed side of it.

p: two-sided, over the looks made (below). Holm's p: that p adjusted for all comparisons
of the investigation in the same world.

Of a claimed difference
    holds           the share is on the claimed side of one half, and p < 0.05
    direction only  it is on that side, p >= 0.05
    null            it is on the other side or on none, Holm's p >= 0.05
    reversed        it is on the other side, and Holm's p < 0.05
Of a claimed "no difference"
    holds           equivalent: two one-sided tests refuse, at 0.04, that the share is
                    0.36 or less and that it is 0.64 or more
    null            neither that nor a difference is shown
    reversed        not equivalent, and Holm's p < 0.05: there is a difference
Of a claimed difference without a direction
    holds           p < 0.05
    null            else

A claim of several comparisons has the least favourable verdict of those that are of its
kind: of the differences where it claims a difference with a p value, of the others
where it claims none; else of all. Each comparison has its own verdict beside it.
Variants (another reading, or other settings where the dissertation is silent) stand
beside the claim and count for nothing in its verdict.

Runs are looked at 10, 20, 30, 50 and 100 a side, and the level is spent over the looks:
a tenth each at 10, 20 and 30, a fifth at 50, half at 100. p is the least of each look's
p over its share. A claimed difference stops at the first look at which p < 0.05 on the
claimed side, or p < 0.0003 on the other (so that Holm's will do), or, from 30 runs on,
both sides are equivalent; a claimed "no difference" stops early only at p < 0.0003, and
is tested for equivalence at 100. Variants stop at 30. What has not stopped, nor reached
its last look, is provisional. Figures are those of the look at which it stopped.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats as scipy_stats

from bns import stats
from bns.claims import measures
from bns.claims.claim import Cell
from bns.claims.provenance import Made
from bns.stats import Interval
from bns.stats.designs import Design, equivalence, power, up_to

LEVEL = 0.05
ALIKE = 0.04
"""level of equivalence: at 0.05 it was shown at the margin in 5.4 % of 20,000 simulated
comparisons in which 100 % of one side and 72 % of the other recover, now in 4.4 %"""
REVERSAL = 0.0003
"""p at which the other side than the claimed stops: 0.05 over more comparisons than any
investigation has"""
ALIKE_FROM = 30  # runs a side: sooner, nothing can be shown to be equivalent
VARIANT_RUNS = 30
ORDER = ("reversed", "null", "direction only", "holds")
"""verdicts, least favourable first"""


Values = Callable[[str], np.ndarray]
"""name of a measure -> its value in every run of a side, ``(R,)``; NaN = none"""


@dataclass(frozen=True)
class Finding:
    """What runs say of a cell.

    Attributes:
        cell: what was compared.
        runs: on each side, at the look where it stopped.
        p_look: two-sided, of that look alone; Mann-Whitney, or the sign test against
            a number.
        p: of all looks made.
        p_equivalent: of the two one-sided tests; 1.0 against a number.
        share: of pairs that a wins, with its 95 % interval.
        stopped: whether the design asks for no more runs.
        power: chance that one test of so many runs finds an effect of this size.
        p_holm: p adjusted over all comparisons of an investigation; 1.0 before that.
        published: whether it came with the package, and not from runs at hand.
        made: from what, when, and by which code; None where that is not known.
    """

    cell: Cell
    runs: tuple[int, ...]
    p_look: float
    p: float
    p_equivalent: float
    share: Interval
    stopped: bool
    power: float = 0.0
    p_holm: float = 1.0
    published: bool = False
    made: Made | None = None

    @property
    def provisional(self) -> bool:
        """Whether the design asks for more runs."""
        return not self.stopped

    @property
    def verdict(self) -> str:
        """One of `ORDER`, by the rule above."""
        says = ">" if len(self.runs) == 1 else self.cell.says
        return verdict(
            says, self.share.value, self.p, self.p_holm, equivalent=self.p_equivalent
        )


def design(cell: Cell) -> Design:
    """The looks at a comparison."""
    return up_to(VARIANT_RUNS) if cell.variant else Design()


def judge(
    cell: Cell, a: Values, b: Values | None, *, looks: Design | None = None
) -> Finding | None:
    """The finding of a cell; None where runs lack what is measured.

    Args:
        cell: what is compared.
        a: measures of the runs of its first side; runs without a value are left out.
        b: those of its second, None for a number.
        looks: at how many runs; by default those of `design`.
    """
    looks = looks or design(cell)
    mine = _known(a(cell.measure))
    if len(mine) == 0:
        return None
    if b is None:
        return _against_number(cell, mine, looks)
    other = _known(b(cell.measure_b or cell.measure))
    if len(other) == 0:
        return None
    if measures.measure(cell.measure).low:
        return examine(cell, -mine, -other, looks)
    return examine(cell, mine, other, looks)


def _known(values: np.ndarray) -> np.ndarray:
    return values[~np.isnan(values)]


def examine(cell: Cell, mine: np.ndarray, other: np.ndarray, looks: Design) -> Finding:
    """The finding of two samples of which more is better, at the look that stops.

    Args:
        cell: what is claimed.
        mine: values of its first side, in the order of runs, ``(N,)``.
        other: of its second, ``(M,)``.
        looks: at how many runs.
    """
    found: list[float] = []
    for runs in looks.made(min(len(mine), len(other))):
        a, b = mine[:runs], other[:runs]
        found.append(stats.mann_whitney(a, b))
        p, alike = looks.p(found), equivalence(a, b)
        value = stats.a12_value(a, b)
        seen = alike if runs >= ALIKE_FROM else 1.0
        stopped = runs == looks.looks[-1] or stops(cell.says, value, p, seen)
        if stopped:
            break
    share = stats.a12(a, b)
    return Finding(
        cell,
        (runs, runs),
        found[-1],
        p,
        alike,
        share,
        stopped,
        power=power(share.value, runs, runs),
    )


def stops(says: str, share: float, p: float, alike: float) -> bool:
    """Whether a look decides.

    Args:
        says: what is claimed: ">", "<", "=", "?".
        share: at this look.
        p: of all looks made.
        alike: p of equivalence; 1.0 where that is not looked at yet.
    """
    if says == "=":
        return p < REVERSAL
    if alike < ALIKE or p < REVERSAL:
        return True
    value = 1 - share if says == "<" else share
    return p < LEVEL and (says == "?" or value > 0.5)


def verdict(
    says: str, share: float, p: float, p_holm: float, *, equivalent: float = 1.0
) -> str:
    """The verdict of one comparison by the rule above.

    Args:
        says: what is claimed of side a: ">", "<", "=" or "?".
        share: A12; against a number the share of runs on the claimed side, with
            `says` ">".
        p: two-sided, over the looks made.
        p_holm: that p, adjusted by Holm's method.
        equivalent: p of the two one-sided tests of equivalence; 1 = not shown.

    Returns:
        "holds", "direction only", "null" or "reversed".
    """
    if says == "=":
        if equivalent < ALIKE:
            return "holds"
        return "reversed" if p_holm < LEVEL else "null"
    if says == "?":
        return "holds" if p < LEVEL else "null"
    value = share if says == ">" else 1 - share
    if value > 0.5:
        return "holds" if p < LEVEL else "direction only"
    return "reversed" if value < 0.5 and p_holm < LEVEL else "null"


def of_claim(kind: str, findings: Iterable[Finding]) -> str:
    """The verdict of a claim from those of its comparisons, by the rule above."""
    found = [each for each in findings if not each.cell.variant]
    if kind in ("S", "N"):
        own = [each for each in found if (each.cell.says == "=") == (kind == "N")]
        found = own or found
    return min((each.verdict for each in found), key=ORDER.index)


def adjusted(findings: Sequence[Finding]) -> list[Finding]:
    """The findings with Holm's p over all of them that are no variants.

    A variant has the p that it would have as one more of them at most: its own, times
    how many there are.
    """
    first = [each for each in findings if not each.cell.variant]
    p = iter(stats.holm([each.p for each in first]))
    many = len(first) + 1
    return [
        replace(
            each,
            p_holm=min(1.0, each.p * many) if each.cell.variant else float(next(p)),
        )
        for each in findings
    ]


def _against_number(cell: Cell, values: np.ndarray, looks: Design) -> Finding:
    """How many runs are on the claimed side; sign test against one half."""
    if cell.at_most is not None:
        there = values <= cell.at_most
    else:
        there = values >= cell.at_least
    found: list[float] = []
    for runs in looks.made(len(there)):
        count = int(there[:runs].sum())
        test = scipy_stats.binomtest(count, runs, 0.5)
        found.append(float(test.pvalue))
        p = looks.p(found)
        stopped = runs == looks.looks[-1] or stops(">", count / runs, p, 1.0)
        if stopped:
            break
    limits = test.proportion_ci(stats.CONFIDENCE, method="wilson")
    share = Interval(count / runs, float(limits.low), float(limits.high))
    chance = _sign_power(share.value, runs)
    return Finding(cell, (runs,), found[-1], p, 1.0, share, stopped, power=chance)


def _sign_power(share: float, runs: int) -> float:
    """Probability that the sign test finds a share."""
    counts = np.arange(runs + 1)
    found = [scipy_stats.binomtest(int(k), runs, 0.5).pvalue < LEVEL for k in counts]
    return float(scipy_stats.binom.pmf(counts[found], runs, share).sum())
