"""Claims that have their verdict in MuJoCo."""

from bench._claims import settled
from bench.result import Result

DOC = "claims with all comparisons at the runs that their design asks for, in MuJoCo"
BAR = ">= 150 of 157"
LEAST = 150


def run(quick: bool) -> Result:
    """Judge what has been run: nothing is trained here; `bns claims run --all` does."""
    del quick
    return settled("mujoco", bar=LEAST)
