"""Effects outside the library called none of the library."""

from bench.gap_runner import ensure
from bench.result import Result, bench


@bench("effects outside the library called none of the library", bar=">= 0.75")
def gap_off_library(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    rows = ensure(quick)
    strange = scoring.of(rows, "off-library")
    known = scoring.of(rows, "single", scoring.LARGE)
    figure = scoring.share(strange, _none)
    return Result(
        figure=figure,
        unit="share",
        holds=figure >= 0.75,
        n=len(strange),
        details={
            "said of effects in the library": scoring.share(known, _none),
            "without cross-talk, which is a shorter axle": scoring.share(
                [row for row in strange if not _like_an_axle(row)], _none
            ),
            "failures": scoring.failures(strange, _none),
        },
    )


def _none(row: dict) -> bool:
    return row["said"]["verdict"] == "none of the library"


def _like_an_axle(row: dict) -> bool:
    return any("cross_talk" in text for text in row["answer"]["effects"])
