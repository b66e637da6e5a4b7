"""No-effect recordings in which a gap is claimed; effects found."""

from bench.gap_runner import ensure
from bench.result import Result, bench


@bench(
    "no-effect recordings in which a gap is claimed; effects found",
    bar="<= 0.03, >= 0.95 found at 3 x",
)
def gap_false_alarm(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    rows = ensure(quick)
    nothing = scoring.of(rows, "none")
    large = scoring.of(rows, "single", scoring.LARGE)
    figure = scoring.share(nothing, _claims)
    found = scoring.share(large, _claims)
    return Result(
        figure=figure,
        unit="share",
        holds=figure <= 0.03 and not found < 0.95,
        n=len(nothing),
        details={
            "found at 3 x": found,
            "with a fault in the data": _faults(scoring.of(rows, "fault")),
            "false alarms": [
                f"{row['seed']}: {row['said']['verdict']} {row['said']['named']}"
                for row in nothing
                if _claims(row)
            ],
        },
    )


def _claims(row: dict) -> bool:
    return row["said"]["verdict"] != "no gap"


def _faults(rows: list[dict]) -> dict[str, float]:
    refused = [row for row in rows if "error" in row["said"]]
    used = [row for row in rows if "verdict" in row["said"]]
    return {
        "cases": len(rows),
        "refused": len(refused),
        "repaired or noticed": sum(bool(row["said"]["faults"]) for row in used),
        "claimed a gap": sum(map(_claims, used)),
    }
