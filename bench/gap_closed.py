"""Gap closed by what the tool chose against the true effects fitted."""

from statistics import median

from bench.gap_runner import ensure
from bench.result import Result, bench


@bench(
    "gap closed by what the tool chose against the true effects fitted", bar=">= 0.90"
)
def gap_closed(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    rows = ensure(quick)
    said = [
        row
        for kind in ("single", "pair")
        for row in scoring.of(rows, kind, scoring.LARGE)
        if row["said"].get("oracle") is not None
    ]
    shares = sorted(min(_share(row), 1.0) for row in said)
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


def _share(row: dict) -> float:
    said = row["said"]
    return (said["before"] - said["after"]) / (said["before"] - said["oracle"])
