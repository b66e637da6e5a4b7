"""Claims that have their verdict in the static-SNN world."""

from bench._claims import settled
from bench.result import Result, bench

LEAST = 120


@bench(
    "claims with all comparisons at the runs that their design asks for, static-SNN",
    bar=">= 120 of 157",
)
def claims_static(quick: bool) -> Result:
    """Judge what has been run: `bns claims run --all --world static-snn` runs it."""
    del quick
    return settled("static-snn", bar=LEAST)
