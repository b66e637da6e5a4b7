"""Intermittent population reset (thesis 5.2.6, table 5.9), without reset-elitists."""

DOC = "fresh random population every so many trials; not told of the damage"
PARAMETERS = {"trials": 10}


def resets(trial: int, onset: int, *, trials: float) -> set[str]:
    """The population, before trials k, 2 k, ...

    Args:
        trial: number of the trial that comes next, counted from 0.
        onset: first damaged trial; not used.
        trials: k, from one reset to the next.

    Returns:
        names of what is reset: "population", or none.
    """
    del onset
    return {"population"} if trial > 0 and trial % trials == 0 else set()
