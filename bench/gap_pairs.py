"""Two withheld effects, both named and no other, aliases merged."""

from bench.gap_runner import ensure
from bench.result import Result, bench


@bench("two withheld effects, both named and no other, aliases merged", bar=">= 0.75")
def gap_pairs(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    rows = ensure(quick)
    pairs = scoring.of(rows, "pair")
    figure = scoring.share(pairs, scoring.right)
    return Result(
        figure=figure,
        unit="share",
        holds=figure >= 0.75,
        n=len(pairs),
        details={
            "strict": scoring.share(pairs, scoring.strict),
            "failures": scoring.failures(pairs, scoring.right),
        },
    )
