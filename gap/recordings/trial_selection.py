"""Which trials of recordings to use: by their conditions, or by their numbers."""

import re
from collections.abc import Callable, Sequence

import numpy as np

from bns.errors import BnsError, UnknownNameError
from bns.worlds.trial import Channel, Trial

SHOWN = 12  # values of a condition that an error lists


def with_conditions(found: list[Trial], only: Sequence[str]) -> list[Trial]:
    """Those of some trials whose conditions are as told.

    Args:
        found: trials.
        only: ``name=value``, all of which have to hold.

    Raises:
        UnknownNameError: no trial has such a condition or value.
    """
    for text in only:
        name, _, value = text.partition("=")
        known = sorted({key for trial in found for key in trial.conditions})
        if not value or (known and name not in known):
            raise UnknownNameError("condition (write name=value)", text, known)
        kept = [t for t in found if _same(t.conditions.get(name), value)]
        if found and not kept:
            there = sorted({str(trial.conditions.get(name)) for trial in found})
            raise UnknownNameError(f"value of {name}", value, there[:SHOWN])
        found = kept
    return found


def numbered(text: str) -> Callable[[int], bool]:
    """Whether a trial is meant by numbers such as "15-19", "15-", "-4" or "0,3,5-7".

    Args:
        text: numbers and ranges, both ends included; empty means all.

    Raises:
        BnsError: it is something else.
    """
    ranges = []
    for part in text.split(",") if text else ["-"]:
        match = re.fullmatch(r"\s*(\d*)\s*(-?)\s*(\d*)\s*", part)
        if not match or not (part.strip() and any(match.groups())):
            raise BnsError(
                f"--trials {text}: {part.strip()!r} is no number of a trial; write "
                "them as 15-19, 15-, -4 or 0,3,5-7, counted from 0."
            )
        first, dash, last = match.groups()
        low = int(first or 0)
        high = int(last) if last else (np.inf if dash else low)
        if high < low:
            raise BnsError(
                f"--trials {text}: {part.strip()!r} is backwards; write {high}-{low}."
            )
        ranges.append((low, high))
    return lambda number: any(low <= number <= high for low, high in ranges)


def _same(given: object, wanted: str) -> bool:
    if isinstance(given, int | float):
        try:
            near = round(given, len(wanted.partition(".")[2]))  # as it was written
            return bool(np.isclose(float(wanted), [given, near]).any())
        except ValueError:
            return False
    return str(given) == wanted


def narrowed(trial: Trial, channels: Sequence[Channel]) -> Trial:
    """A trial with the first channels alone.

    Args:
        trial: recorded trial.
        channels: those that come first.
    """
    count = len(channels)
    if len(trial.channels) == count:
        return trial
    return trial.replace(
        observed=trial.observed[:, :count], channels=trial.channels[:count]
    )
