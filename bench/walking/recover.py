"""Recovery from raised legs with a sliding window of 300 patterns."""

from typing import get_args

import numpy as np

from bench.learning import solving
from bench.result import Result, bench
from bench.walking import ceiling, runs
from bench.walking.runs import spread
from bns.experiment.record import RunRecord

BARS = (0.5, 0.75, 0.9)  # of the damage's ceiling, whatever the robot did before
MILD, LIMIT_MILD, LIMIT = ("type0", "type1", "type3"), 30, 46


@bench(
    "worst median of trials until a damaged hexapod walks 90 % as far as before",
    bar="median <= 30 trials for types 0, 1, 3 and <= 46 for types 2, 5; window 300",
)
def recover_hexapod(quick: bool) -> Result:
    """Damage from trial 100 of 150; quick: one run of 12 trials.

    The runs of all types are those of `hexapod-gait` up to the damage. The figure is
    that of the window, ten runs a type; beside it, from the same undamaged runs on,
    what forgetting by evidence comes to (`watch.forget`), and the presets
    `hexapod-recover`, thirty runs a type, and `hexapod-nominal`, from runs of its own.
    """
    records, others, *ours = (
        runs.recovering(kind, quick=quick) for kind in get_args(runs.Kind)
    )
    hand = runs.by_hand()
    found: dict[str, object] = {}
    medians, holds = [], True
    for legs, record in records.items():
        row = found[legs] = _recovery(legs, record, hand)
        row["with watch.forget"] = {
            **_recovery(legs, others[legs], hand),
            "trials until it forgot": solving.waits(_forgot(others[legs])),
        }
        for preset, found_by in zip(("hexapod-recover", runs.OWN), ours, strict=True):
            row[preset] = _recovery(legs, found_by[legs], hand)
        median = row["median"]
        limit = LIMIT_MILD if legs in MILD else LIMIT
        holds = holds and median is not None and median <= limit
        medians.append(10.0 * record.trials if median is None else median)
    return Result(
        figure=max(medians),
        unit="trials",
        holds=None if quick else holds,
        n=min(record.replicates for record in records.values()),
        details=found,
    )


def _forgot(record: RunRecord) -> np.ndarray:
    """Trials with the damage until old patterns were dropped, ``(R,)``; inf = never."""
    onset = int(record.damage_onset[0])
    dropped = np.diff(record["patterns"][:, onset - 1 :], axis=1) < 0
    return np.where(dropped.any(1), dropped.argmax(1) + 1.0, np.inf)


def _recovery(legs: str, record: RunRecord, hand: runs.Hand) -> dict[str, object]:
    onset, ways = int(record.damage_onset[0]), record["distance"]
    late = np.median(ways[:, -runs.BEFORE :], axis=1)
    enough = runs.SHARE * runs.before(record)
    adequate = runs.adequate(record, hand)
    return {
        **solving.waits(runs.trials_to_regain(record)),
        "until adequate again": solving.waits(solving.first(adequate[:, onset:])),
        "as far undamaged, from the start": solving.waits(
            solving.first(ways[:, :onset] >= enough[:, None])
        ),
        "before [m]": spread(runs.before(record)),
        "first damaged trial [m]": spread(ways[:, onset]),
        "last ten trials [m]": spread(late),
        "ceiling [m]": ceiling.ceilings(legs),
        "share of the ceiling": ceiling.shares(late, legs),
        "until a share of the ceiling": until(ways[:, onset:], legs),
    }


def until(ways: np.ndarray, legs: str) -> dict[str, dict[str, object]]:
    """Trials until robots got to `BARS` of each ceiling of a damage that is known.

    Args:
        ways: of the trials with the damage, ``(R, T)`` [m].
        legs: the damage.
    """
    return {
        name: {
            f"{bar:.0%}": solving.waits(solving.first(ways >= bar * most))
            for bar in BARS
        }
        for name, most in ceiling.ceilings(legs).items()
    }
