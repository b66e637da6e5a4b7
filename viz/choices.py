"""Which replicate and which trials a picture shows."""

from dataclasses import dataclass

import numpy as np

from bns.errors import OutOfBoundsError
from bns.experiment.record import RunRecord
from bns.viz import style


@dataclass(frozen=True)
class Choice:
    """One trial to show.

    Attributes:
        trial: its number, counted from 0.
        label: what it shows, in words ("before damage").
        colour: of its trail, ``#rrggbb``.
    """

    trial: int
    label: str
    colour: str


def choose(record: RunRecord, replicate: int) -> tuple[Choice, ...]:
    """The trials that tell a run's story.

    With damage: the last solved trial before it, the first damaged trial, and the
    first solved trial after that; where none was solved, the one with the lowest
    fitness stands in and its label says so. Without damage: the first trial, the
    first solved one, the last one. Trials that coincide are shown once.
    """
    check(record, replicate)
    onset = int(record.damage_onset[replicate])
    if not 0 <= onset < record.trials:
        found = _without_damage(record, replicate)
    else:
        found = _with_damage(record, replicate, onset)
    kept: dict[int, Choice] = {}
    for choice in found:
        kept.setdefault(choice.trial, choice)
    return tuple(kept.values())


def typical(record: RunRecord) -> int:
    """The replicate to show when none is asked for.

    Of the replicates that recovered (or, undamaged, that solved): the one that took
    the median number of trials. Those that had not solved before the damage count
    only if all recovered ones are such. If none recovered: the one with the lowest
    fitness at the end.
    """
    waits = [_wait(record, replicate) for replicate in range(record.replicates)]
    done = [(wait, index) for index, wait in enumerate(waits) if wait is not None]
    whole = [entry for entry in done if _solved_before(record, entry[1])]
    done = whole or done
    if not done:
        return int(np.nanargmin(record["fitness"][:, -1]))
    return sorted(done)[(len(done) - 1) // 2][1]


def check(record: RunRecord, replicate: int) -> None:
    """Raise if a record has no such replicate.

    Raises:
        OutOfBoundsError: there is no such replicate.
    """
    if not 0 <= replicate < record.replicates:
        raise OutOfBoundsError("replicate", replicate, 0, record.replicates - 1, "1")


def _wait(record: RunRecord, replicate: int) -> int | None:
    start = max(int(record.damage_onset[replicate]), 0)
    solved = np.flatnonzero(record["solved"][replicate, start:])
    return int(solved[0]) if len(solved) else None


def _solved_before(record: RunRecord, replicate: int) -> bool:
    onset = int(record.damage_onset[replicate])
    return onset <= 0 or bool(record["solved"][replicate, :onset].any())


def _with_damage(record: RunRecord, replicate: int, onset: int) -> list[Choice]:
    solved, fitness = record["solved"][replicate] > 0, record["fitness"][replicate]
    found = []
    if onset > 0:
        earlier = np.flatnonzero(solved[:onset])
        best = earlier[-1] if len(earlier) else _lowest(fitness[:onset])
        label = "before damage" if len(earlier) else "before damage (unsolved)"
        found.append(Choice(int(best), label, style.BEFORE))
    found.append(Choice(onset, "just damaged", style.DAMAGED))
    if onset + 1 < record.trials:
        later = np.flatnonzero(solved[onset + 1 :])
        best = later[0] if len(later) else _lowest(fitness[onset + 1 :])
        label = "recovered" if len(later) else "best after damage (unsolved)"
        found.append(Choice(onset + 1 + int(best), label, style.AFTER))
    return found


def _without_damage(record: RunRecord, replicate: int) -> list[Choice]:
    solved = np.flatnonzero(record["solved"][replicate])
    middle = solved[0] if len(solved) else _lowest(record["fitness"][replicate])
    label = "first solved" if len(solved) else "best (unsolved)"
    return [
        Choice(0, "first trial", style.DAMAGED),
        Choice(int(middle), label, style.BEFORE),
        Choice(record.trials - 1, "last trial", style.AFTER),
    ]


def _lowest(fitness: np.ndarray) -> int:
    finite = np.where(np.isfinite(fitness), fitness, np.inf)
    return int(finite.argmin())
