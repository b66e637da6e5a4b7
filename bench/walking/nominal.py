"""The preset that begins with a model of its legs, and which legs it tells are lost."""

from collections.abc import Sequence

import numpy as np

from bench.learning import experiments
from bench.result import Result, bench
from bench.walking import gait, runs
from bns.experiment.record import RunRecord
from bns.learners.bns import bearing
from bns.learners.bns.nominal import NONE, Lost
from bns.learners.bns.walking import MOVED, of_trial
from bns.models.phantomx import kinematics
from bns.worlds.effects import leg_sets

AGAIN = {"type0": 5, "type1": 5, "type3": 5, "type2": 12, "type5": 8}
"""trials until adequate again, at most"""
ADEQUATE = 20  # trials until adequate for the first time, at most
RANDOM = ("", *(f"type{number}" for number in (0, 1, 2, 3, 4, 5, 7, 12, 14)))
"""damages of random trials, "" = none"""


@bench(
    "damages of five after which a hexapod, told nothing, is soon adequate again",
    bar="medians <= 5, 5, 5, 12, 8 trials (types 0, 1, 3, 2, 5); at first <= 20",
)
def hexapod_nominal(quick: bool) -> Result:
    """Preset `hexapod-nominal`: 100 trials undamaged, 50 with legs raised.

    Beside it: how far it walks, which legs it takes for lost, trials to shares of the
    ceilings, and to 90 % as far as before. Quick: one run of 12 trials.
    """
    sound, hand = runs.walking("nominal", quick=quick), runs.by_hand()
    first = experiments.waits(experiments.first(runs.adequate(sound, hand)))
    found, held = {}, 0
    for legs, record in runs.recovering("nominal", quick=quick).items():
        row = gait.recovery(legs, record, hand)
        row["legs told"] = told(record, lost(legs))
        median = row["until adequate again"]["median"]
        held += median is not None and median <= AGAIN[legs]
        found[legs] = row
    early = first["median"] is not None and first["median"] <= ADEQUATE
    return Result(
        figure=held,
        unit=f"of {len(AGAIN)}",
        holds=None if quick else bool(early and held == len(AGAIN)),
        n=sound.replicates,
        details={
            "trials to the tripod's distance in its time": first,
            "undamaged": gait.at_the_end(sound),
            "taken for lost though sound": told(sound, NONE),
            "likeliest set right, of random trials": random_trials(quick),
            **found,
        },
    )


def lost(damage: str) -> Lost:
    """The legs that a damage raises, by their place; "" = none."""
    return frozenset(leg - 1 for leg in leg_sets.read(damage)) if damage else NONE


def told(record: RunRecord, legs: Lost) -> dict[str, object]:
    """How a record's robots told which legs are lost, over its last trials.

    Args:
        record: of runs with `walk.lost_legs`.
        legs: that are lost in truth, by their place, at the end.
    """
    said = np.array([[_places(x) for x in row] for row in record["legs_lost"]])
    truth = np.isin(np.arange(6), list(legs))
    late = said[:, -gait.LATE :]
    onset = max(int(record.damage_onset[0]), 0)
    right = (said[:, onset:] == truth).all(2)
    return {
        "legs wrong, mean": round(float((late != truth).sum(2).mean()), 3),
        "all right, share of the last ten trials": round(
            float((late == truth).all(2).mean()), 3
        ),
        "trials until all right": experiments.waits(experiments.first(right)),
    }


def random_trials(quick: bool) -> dict[str, dict[str, int]]:
    """How often the likeliest set of lost legs is the right one, of random trials."""
    counts = (2,) if quick else (2, 4, 8, 12)
    found = {f"{count} trials": {"right": 0, "of": 0} for count in counts}
    for seed in range(1 if quick else 2):
        rng = np.random.default_rng(seed)
        goals = rng.uniform(-0.6, 0.6, (max(counts), 11, 18))
        for name in RANDOM[: 2 if quick else None]:
            damage = f"leg_raised:legs={name},blend=1" if name else ""
            seen = [of_trial(trial) for trial in runs.walked(goals, damage=damage)]
            for count in counts:
                row = found[f"{count} trials"]
                row["right"] += _likeliest(seen[:count]) == lost(name)
                row["of"] += 1
    return found


def _likeliest(seen: Sequence[tuple[np.ndarray, np.ndarray]]) -> Lost:
    inputs, moved = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    told = bearing.told(inputs, kinematics.contacts)
    odds = bearing.odds(inputs, moved / np.array(MOVED), told)
    return bearing.ACCOUNTS[int(odds.argmax())]


def _places(digits: float) -> list[bool]:
    return [str(leg) in str(int(digits)) for leg in range(1, 7)]
