"""Intermittent population reset (thesis 5.2.6, table 5.9), without reset-elitists."""

DOC = "fresh random population every so many trials; not told of the damage"
PARAMETERS = {"trials": 10}


def resets(trial: int, onset: int, *, trials: float) -> set[str]:
    """The population, before trials k, 2 k, ..."""
    del onset
    return {"population"} if trial > 0 and trial % trials == 0 else set()
