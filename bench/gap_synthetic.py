"""Withheld single effects named, aliases merged, at 3 x their detectability."""

from bench.gap_runner import ensure
from bench.result import Result, bench

ANGLE = 11.48  # [deg] whose cosine is 0.98


@bench(
    "withheld single effects named, aliases merged, at 3 x their detectability",
    bar=">= 0.95",
)
def gap_synthetic(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    rows = ensure(quick)
    every = scoring.of(rows, "single")
    large = scoring.of(rows, "single", scoring.LARGE)
    figure = scoring.share(large, scoring.right)
    named = {
        key: scoring.share(large, lambda row, key=key: _baseline(row, key))
        for key in ("iid", "largest", "forward")
    }
    return Result(
        figure=figure,
        unit="share",
        holds=figure >= 0.95,
        n=len(large),
        details={
            "strict": scoring.share(large, scoring.strict),
            "merged by angle as well": scoring.share(large, _by_angle),
            "among those named": scoring.share(large, scoring.among),
            "named alone, and wrong": scoring.share(large, scoring.confident_wrong),
            "named as one of several": scoring.share(
                large, lambda row: row["said"]["verdict"] == "either"
            ),
            "baselines": named,
            "by size": scoring.by_size(every),
            "parameter": scoring.parameter(large),
            "parameter, from 1 x": scoring.parameter(scoring.of(rows, "single", 1.0)),
            "confusion": scoring.confusion(large),
            "failures": scoring.failures(large, scoring.right),
        },
    )


def _by_angle(row: dict) -> bool:
    """With effects merged whose signatures are less than `ANGLE` apart."""
    from bns.gap.bench import scoring

    named = row["said"]["named"]
    return bool(named) and scoring.matches(named[0], row["answer"], angle=ANGLE)


def _baseline(row: dict, key: str) -> bool:
    return any(
        row["said"]["baselines"][key] in names for names in row["answer"]["aliases"]
    )
