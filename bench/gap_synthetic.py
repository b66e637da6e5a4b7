"""Withheld single effects named, aliases merged, at 3 x their detectability."""

from bench.gap_runner import ensure
from bench.result import Result

DOC = "withheld single effects named, aliases merged, at 3 x their detectability"
BAR = ">= 0.95"


def run(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    rows = ensure(quick)
    every = scoring.of(rows, "single")
    large = scoring.of(rows, "single", scoring.LARGE)
    figure = scoring.share(large, scoring.right)
    return Result(
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
