"""A gap that shows in the gain by one effect alone has to show in every recording.

Among hundreds of candidates one now and then follows the noise of a recording closely.
It then improves nothing on recordings that it was not fitted to; where these have no
structure without any effect either, nothing speaks for a gap.
"""

from dataclasses import replace

from bns.gap.diagnose import Analysis
from bns.gap.records import Verdict
from bns.gap.report.verdict_words import sentence


def confirmed(made: Analysis) -> Analysis:
    """The analysis; without a gap where no recording confirms what another shows."""
    rung = made.choice.rung
    p_rest = min(1.0, 2 * rung.p_misfit)
    claimed = made.verdict.kind == "none of the library" and not rung.size
    if not claimed or p_rest <= made.rules.alpha_gap:
        return made
    return replace(made, verdict=_without(made.verdict, p_rest))


def _without(answer: Verdict, p_gap: float) -> Verdict:
    return replace(
        answer,
        kind="no gap",
        named=(),
        sets=((),),
        p_gap=p_gap,
        sentence=sentence("no gap", (), (), 90.0, p_gap, answer.p_misfit),
        change="",
    )
