"""Effects that look alike are reported as a set, never one alone."""

from bench.gap_runner import ensure
from bench.result import Result, bench


@bench("effects that look alike are reported as a set, never one alone", bar=">= 0.95")
def gap_alias(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    rows = ensure(quick)
    rows = [*scoring.of(rows, "single", 1.0), *scoring.of(rows, "alias", 1.0)]
    rows = [row for row in rows if scoring.aliased(row)]
    rows = [r for r in rows if r["said"]["verdict"] != "no gap"]
    figure = scoring.share(
        rows, lambda r: r["said"]["verdict"] == "either" and scoring.listed(r)
    )
    return Result(
        figure=figure,
        unit="share",
        holds=figure >= 0.95,
        n=len(rows),
        details={
            "planted": sum(row["kind"] == "alias" for row in rows),
            "confident and wrong": scoring.share(rows, scoring.confident_wrong),
            "failures": scoring.failures(rows, scoring.listed),
        },
    )
