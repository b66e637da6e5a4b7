"""What the trials of recordings are called: by the numbers that they had there."""

from collections.abc import Sequence

from bns.worlds.trial import Trial

NUMBER, RUN, RECORDING = "number", "run", "recording"
"""conditions that say so; `bns.gap.recordings.load_recordings` writes them"""


def labelled(trial: Trial, number: int, **others: object) -> Trial:
    """A trial that knows its number, and its run and recording where told."""
    known = {key: value for key, value in others.items() if value is not None}
    return trial.replace(conditions={**trial.conditions, NUMBER: number, **known})


def of(trial: Trial, place: int) -> str:
    """Such as "trial 16 of run 1".

    Args:
        trial: of a recording.
        place: its place among all, which is its number if it has none.
    """
    known = trial.conditions
    parts = [f"trial {known.get(NUMBER, place)}"]
    parts += [f"run {known[RUN]}"] if RUN in known else []
    parts += [str(known[RECORDING])] if RECORDING in known else []
    return " of ".join(parts)


def numbers(trials: Sequence[Trial]) -> list[int]:
    """The number of each, or the places where they have none or share one."""
    own = [trial.conditions.get(NUMBER) for trial in trials]
    known = [number for number in own if isinstance(number, int)]
    if len(known) == len(own) and len(set(known)) > 1:
        return known
    return list(range(len(trials)))
