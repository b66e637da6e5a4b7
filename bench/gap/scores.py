"""What the wheeled diagnosis says of its scored cases, beside the truth."""

from statistics import median

from bench.gap.kept_cases import made
from bench.gap.wheeled_cases import ensure
from bench.result import Result, bench
from bns.gap.bench import scoring


@bench(
    "withheld single effects named, aliases merged, at 3 x their detectability",
    bar=">= 0.95",
)
def gap_synthetic(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    rows = ensure(quick)
    every = scoring.of(rows, "single")
    large = scoring.of(rows, "single", scoring.LARGE)
    figure = scoring.share(large, scoring.right)
    return Result(
        **made(rows),
        figure=figure,
        unit="share",
        holds=figure >= 0.95,
        n=len(large),
        details={
            "strict": scoring.share(large, scoring.strict),
            "among those named": scoring.share(large, scoring.among),
            "named alone, and wrong": scoring.share(large, scoring.confident_wrong),
            "named as one of several": scoring.share(
                large, lambda row: row["said"]["verdict"] == "either"
            ),
            "by size": scoring.by_size(every),
            "parameter": scoring.parameter(large),
            "parameter, from 1 x": scoring.parameter(scoring.of(rows, "single", 1.0)),
            "confusion": scoring.confusion(large),
            "failures": scoring.failures(large, scoring.right),
        },
    )


@bench("two withheld effects, both named and no other, aliases merged", bar=">= 0.75")
def gap_pairs(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    rows = ensure(quick)
    pairs = scoring.of(rows, "pair")
    figure = scoring.share(pairs, scoring.right)
    return Result(
        **made(rows),
        figure=figure,
        unit="share",
        holds=figure >= 0.75,
        n=len(pairs),
        details={
            "strict": scoring.share(pairs, scoring.strict),
            "failures": scoring.failures(pairs, scoring.right),
        },
    )


@bench("effects that look alike are reported as a set, never one alone", bar=">= 0.95")
def gap_alias(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    rows = ensure(quick)
    rows = [*scoring.of(rows, "single", 1.0), *scoring.of(rows, "alias", 1.0)]
    rows = [row for row in rows if scoring.aliased(row)]
    rows = list(filter(scoring.claims, rows))
    figure = scoring.share(
        rows, lambda r: r["said"]["verdict"] == "either" and scoring.listed(r)
    )
    return Result(
        **made(rows),
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


@bench("effects outside the library called none of the library", bar=">= 0.75")
def gap_off_library(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    rows = ensure(quick)
    strange = scoring.of(rows, "off-library")
    known = scoring.of(rows, "single", scoring.LARGE)
    figure = scoring.share(strange, scoring.strange)
    return Result(
        **made(rows),
        figure=figure,
        unit="share",
        holds=figure >= 0.75,
        n=len(strange),
        details={
            "said of effects in the library": scoring.share(known, scoring.strange),
            "without cross-talk, which is a shorter axle": scoring.share(
                [row for row in strange if not _like_an_axle(row)],
                scoring.strange,
            ),
            "failures": scoring.failures(strange, scoring.strange),
        },
    )


def _like_an_axle(row: dict) -> bool:
    return any("cross_talk" in text for text in row["answer"]["effects"])


@bench(
    "no-effect recordings in which a gap is claimed; effects found",
    bar="<= 0.03, >= 0.95 found at 3 x",
)
def gap_false_alarm(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    rows = ensure(quick)
    nothing = scoring.of(rows, "none")
    large = scoring.of(rows, "single", scoring.LARGE)
    figure = scoring.share(nothing, scoring.claims)
    found = scoring.share(large, scoring.claims)
    return Result(
        **made(rows),
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
                if scoring.claims(row)
            ],
        },
    )


def _faults(rows: list[dict]) -> dict[str, float]:
    refused = [row for row in rows if "error" in row["said"]]
    used = [row for row in rows if "verdict" in row["said"]]
    return {
        "cases": len(rows),
        "refused": len(refused),
        "repaired or noticed": sum(bool(row["said"]["faults"]) for row in used),
        "claimed a gap": sum(map(scoring.claims, used)),
    }


@bench("share of the gap closed on motion that was not fitted", bar=">= 0.90")
def gap_closed(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
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
        **made(rows),
        figure=figure,
        unit="share",
        holds=figure >= 0.90,
        n=len(said),
        details={
            "mean": sum(shares) / max(len(shares), 1),
            "lowest tenth": shares[len(shares) // 10] if shares else None,
        },
    )


@bench("error of the edited twin against that of the true one", bar="<= 1.5 x")
def gap_edit(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    rows = ensure(quick)
    edits = [r["said"]["edit"] for r in scoring.of(rows, "pair") if "edit" in r["said"]]
    ratios = sorted(edit["ours"] / edit["oracle"] for edit in edits)
    figure = median(ratios) if ratios else float("nan")
    return Result(
        **made(rows),
        figure=figure,
        unit="x",
        holds=figure <= 1.5,
        n=len(ratios),
        details={"ratios": [round(ratio, 3) for ratio in ratios]},
    )
