"""90 % intervals of the magnitudes of named effects: how many hold the truth."""

from bench.gap_runner import ensure
from bench.result import Result, bench


@bench(
    "90 % intervals of magnitudes that hold the truth, where it was named",
    bar="0.85 to 0.95",
)
def gap_intervals(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring
    from bns.gap.core import conformal

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
            conformal.TIMING: _share([r for r in named if _about(r, True)]),
            conformal.OTHER: _share([r for r in named if _about(r, False)]),
        },
    )


def _about(row: dict, time: bool) -> bool:
    """Whether all of a row's effects are about time, or none of them."""
    from bns.gap.bench import scoring
    from bns.gap.core import conformal

    groups = {
        conformal.group(*scoring.described(name)) for name in row["answer"]["names"]
    }
    return groups == {conformal.TIMING if time else conformal.OTHER}


def _share(rows: list[dict]) -> dict[str, float]:
    from bns.gap.bench import scoring

    return {"n": len(rows), "held": scoring.parameter(rows)["intervals that hold"]}
