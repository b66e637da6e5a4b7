"""Claims of light following (investigations B, C) that survive Holm, or nearly."""

from bench._claims import judged
from bench.result import Result

DOC = "claims of closed-loop control (B and C) with a verdict"
BAR = "14 of 14, printed whichever way"
WANTED = ("B2", "B3", "B9", "B15", "B16", "B24", "B30", "B31")
WANTED += ("C11", "C13", "C15", "C17", "C19", "C22")
RUNS = 30  # a side, at least; provisional where the dissertation has a hundred


def run(quick: bool) -> Result:
    """Train what is neither here nor published, `RUNS` a side; quick: small and short.

    Settings are the dissertation's (tables 5.1 and 6.1) over the preset; runs are
    kept, so a run that is stopped goes on.
    """
    return judged(WANTED, runs=RUNS, quick=quick)
