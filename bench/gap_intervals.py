"""90 % intervals of the magnitudes of named effects: how many hold the truth."""

from bench.gap_runner import ensure
from bench.result import Result

DOC = "90 % intervals of magnitudes that hold the truth, where it was named"
BAR = "0.85 to 0.95"


def run(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    found = [row for row in ensure(quick) if "verdict" in row["said"]]
    known = [row for row in found if row["kind"] in ("single", "pair")]
    named = [row for row in known if scoring.listed(row)]
    figures = scoring.parameter(named)
    figure = figures["intervals that hold"]
    return Result(
        figure=figure,
        unit="share",
        holds=0.85 <= figure <= 0.95 if named else None,
        n=sum(len(row["answer"]["names"]) for row in named),
        details={
            "median relative error": figures["median relative error"],
            "single": _share([r for r in named if r["kind"] == "single"]),
            "single, 3 times detectable or more": _share(
                scoring.of(named, "single", 3.0)
            ),
            "pair": _share([r for r in named if r["kind"] == "pair"]),
        },
    )


def _share(rows: list[dict]) -> dict[str, float]:
    from bns.gap.bench import scoring

    return {"n": len(rows), "held": scoring.parameter(rows)["intervals that hold"]}
