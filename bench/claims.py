"""Claims that have their verdict in MuJoCo."""

from bench._claims import settled
from bench.result import Result, bench

LEAST = 150


@bench(
    "claims with all comparisons at the runs that their design asks for, in MuJoCo",
    bar=">= 150 of 157",
)
def claims(quick: bool) -> Result:
    """Judge what has been run: nothing is trained here; `bns claims run --all` does."""
    del quick
    return settled("mujoco", bar=LEAST)
