"""Sets of single effects: coverage, mean size with aliases merged.

Scored is what a user sees: single effects of any size that were named. They have seeds
of their own. The details have the rates by size, and those of the pairs of the other
benches.
"""

from bench.gap.kept_cases import made
from bench.gap.wheeled_cases import SEALED, ensure, produce, rows
from bench.result import Result, bench
from bns.gap.bench import scoring

SEED, CASES = SEALED + 500_000, 140
EDGES = ((0.0, 1.0), (1.0, 3.0), (3.0, float("inf")), (1.0, float("inf")))


@bench(
    "90 % sets of single effects: coverage, mean size with aliases merged",
    bar="0.87 to 0.93, size <= 1.6",
)
def gap_sets(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    cases = [("single", SEED + n) for n in range(2 if quick else CASES)]
    produce(cases, "sets")
    fresh = [r for r in rows("sets") if (r["kind"], r["seed"]) in set(cases)]
    said = _named(fresh, "single")
    figure = scoring.share(said, scoring.covered)
    mean = _mean(scoring.merged(row) for row in said)
    return Result(
        **made(fresh),
        figure=figure,
        unit="share",
        holds=0.87 <= figure <= 0.93 and mean <= 1.6,
        n=len(said),
        details={
            "interval, 90 %": _interval(said),
            "mean size": mean,
            "mean size, aliases apart": _mean(len(r["said"]["sets"]) for r in said),
            "best alone": scoring.share(said, _first),
            "by size": [_part(said, low, high) for low, high in EDGES],
            "pairs": _part(_named(ensure(quick), "pair"), 0.0, float("inf")),
            "failures": scoring.failures(said, scoring.covered),
        },
    )


def _named(found: list[dict], kind: str) -> list[dict]:
    return [row for row in scoring.of(found, kind) if row["said"]["named"]]


def _part(said: list[dict], low: float, high: float) -> dict[str, float | None]:
    part = [row for row in said if low <= scoring.size(row) < high]
    return {
        "from": low,
        "to": high if high < float("inf") else None,
        "n": len(part),
        "covered": scoring.share(part, scoring.covered),
        "mean size": _mean(scoring.merged(row) for row in part),
    }


def _interval(said: list[dict]) -> list[float]:
    """In which the rate lies that this many cases show (Clopper and Pearson 1934)."""
    from scipy.stats import binomtest

    held = sum(scoring.covered(row) for row in said)
    if not said:
        return []
    found = binomtest(held, len(said)).proportion_ci(0.9, method="exact")
    return [float(found.low), float(found.high)]


def _first(row: dict) -> bool:
    """Whether the best support is the true one, aliases not merged."""
    return sorted(row["said"]["sets"][0]) == sorted(row["answer"]["names"])


def _mean(values) -> float:
    values = list(values)
    return sum(values) / len(values) if values else float("nan")


@bench(
    "90 % intervals of magnitudes that hold the truth, where it was named",
    bar="0.85 to 0.95",
)
def gap_intervals(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    found = [row for row in ensure(quick) if "verdict" in row["said"]]
    known = [row for row in found if row["kind"] in ("single", "pair")]
    named = [row for row in known if scoring.listed(row)]
    figures = scoring.parameter(named)
    figure = figures["intervals that hold"]
    return Result(
        **made(found),
        figure=figure,
        unit="share",
        holds=0.85 <= figure <= 0.95 if named else None,
        n=sum(len(row["answer"]["names"]) for row in named),
        details={
            "median relative error": figures["median relative error"],
            "single": _rate([r for r in named if r["kind"] == "single"]),
            "single, 3 times detectable or more": _rate(
                scoring.of(named, "single", 3.0)
            ),
            "pair": _rate([r for r in named if r["kind"] == "pair"]),
        },
    )


def _rate(rows: list[dict]) -> dict[str, float]:
    return {"n": len(rows), "held": scoring.parameter(rows)["intervals that hold"]}
