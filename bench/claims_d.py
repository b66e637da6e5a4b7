"""Claims of the hexapod (investigation D) that the dissertation rests on."""

from bench._claims import judged
from bench.result import Result

DOC = "claims D1, D20, D22, D25, D27, D29 with a verdict (types 0 and 14)"
BAR = "6 of 6, printed whichever way"
WANTED = ("D1", "D20", "D22", "D25", "D27", "D29")
RUNS = 4  # a side, at least; with fewer than 30 or 100 a verdict is provisional


def run(quick: bool) -> Result:
    """Train what is neither here nor published, `RUNS` a side; quick: small and short.

    Settings are the dissertation's (table 7.2) over the preset; runs are kept, so a
    run that is stopped goes on.
    """
    return judged(WANTED, runs=RUNS, quick=quick)
