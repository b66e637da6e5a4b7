"""Share of the gap that is closed on motion that was not fitted."""

from statistics import median

from bench.gap_runner import ensure
from bench.result import Result

DOC = "share of the gap that is closed on motion that was not fitted"
BAR = ">= 0.90"


def run(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    rows = ensure(quick)
    said = [
        row
        for kind in ("single", "pair")
        for row in scoring.of(rows, kind, scoring.LARGE)
        if row["said"]["named"]
    ]
    shares = sorted(row["said"]["closed"] for row in said)
    figure = median(shares) if shares else float("nan")
    return Result(
        figure=figure,
        unit="share",
        holds=figure >= 0.90,
        n=len(said),
        details={
            "mean": sum(shares) / max(len(shares), 1),
            "lowest tenth": shares[len(shares) // 10] if shares else None,
        },
    )
