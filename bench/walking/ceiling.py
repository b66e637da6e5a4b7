"""The ceiling of walking: CMA-ES in the damaged world itself, no SNN in between.

It starts from the farthest walk that BNS found on that damage or undamaged, and goes on
for `BUDGET` trials, a thousand times cheaper to have than a robot's. What is learned in
the world with a hundred trials is then a share of what is possible. The preset's goals
stay near half-way (`walk.reach`), which the servos do not ask for; so there are two
ceilings, within its reach and in full.
"""

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from bench.learning import experiments
from bench.result import Result, bench
from bench.runner import stored, write
from bench.walking import runs
from bns import presets, seeding
from bns.experiment.record import RunRecord

NONE = "none"  # no damage
WANTED = (NONE, "type0", "type1", "type2", "type3", "type5", "type14")
OTHERS = tuple(f"type{n}" for n in range(16) if f"type{n}" not in WANTED)
POPULATION, STAGE = 20, 10  # generations of a stage
BUDGET = 50 * POPULATION  # trials
STEP = 0.1  # [rad] first standard deviation of a goal
REACH = presets.load("hexapod-walk").walk.reach  # [rad] of the preset
BOTH = {"in full": None, "within the preset's reach": REACH}


@bench(
    "farthest walk that CMA-ES finds in the world itself, undamaged, and "
    "by damage type, in full and within the preset's reach",
    bar="none: printed beside hexapod-gait and recover-hexapod",
)
def hexapod_ceiling(quick: bool) -> Result:
    """Two searches a damage; quick: those known already, and none anew."""
    find = known if quick else reached
    wanted = {None: (*WANTED, *OTHERS), REACH: WANTED}
    found = {
        name: {legs: find(legs, reach) for legs in wanted[reach]}
        for name, reach in BOTH.items()
    }
    ways = {
        name: {legs: way for legs, way in each.items() if way is not None}
        for name, each in found.items()
    }
    return Result(
        figure=ways["in full"].get(NONE, 0.0),
        unit="m",
        holds=None,
        n=sum(map(len, ways.values())),
        details={
            **{_title(reach): ways[name] for name, reach in BOTH.items()},
            "trials of a search": BUDGET,
        },
    )


def known(legs: str, reach: float | None = None) -> float | None:
    """The farthest walk found on one damage [m], if it has been searched, here or in
    the committed results.

    Args:
        legs: as for `reached`.
        reach: likewise.
    """
    place = _place(legs, reach)
    row = json.loads(place.read_text()) if place.exists() else {"trials": 0}
    if row["trials"] >= BUDGET:
        return float(row["farthest [m]"])
    return _published().get(_title(reach), {}).get(legs)


def _title(reach: float | None) -> str:
    return "farthest [m]" if reach is None else f"farthest within {reach:g} rad [m]"


@cache
def _published() -> dict[str, dict[str, float]]:
    row = stored().get("hexapod-ceiling")
    return row["details"] if row else {}


def shares(ways: np.ndarray, legs: str) -> dict[str, dict[str, float]]:
    """Distances [m] as shares of the ceilings that are known."""
    return {name: runs.spread(ways / most) for name, most in ceilings(legs).items()}


def ceilings(legs: str) -> dict[str, float]:
    """Of one damage those of `BOTH` that are known [m]."""
    found = {name: known(legs, reach) for name, reach in BOTH.items()}
    return {name: most for name, most in found.items() if most is not None}


def reached(legs: str, reach: float | None = None) -> float:
    """The farthest walk found on one damage [m]; kept stage by stage, as it is dear.

    Args:
        legs: as the effect `leg_raised` takes them, or `NONE`.
        reach: farthest that a goal may be from half-way [rad]; None = the end stops.
    """
    place = _place(legs, reach)
    row = json.loads(place.read_text()) if place.exists() else _begun(legs, reach)
    while row["trials"] < BUDGET:
        goals, farthest, step = search(
            np.array(row["goals [rad]"]),
            legs,
            step=row["step [rad]"],
            seed=seeding.integer(row["trials"], "hexapod-ceiling", legs),
            reach=reach,
        )
        if farthest > row["farthest [m]"]:
            row |= {"farthest [m]": round(farthest, 4), "goals [rad]": goals.tolist()}
        row |= {"trials": row["trials"] + POPULATION * STAGE, "step [rad]": step}
        place.parent.mkdir(parents=True, exist_ok=True)
        write(place, json.dumps(row))
    return float(row["farthest [m]"])


def _begun(legs: str, reach: float | None) -> dict:
    start, begun = _start(legs, reach)
    return {
        "farthest [m]": begun,
        "started from [m]": round(begun, 4),
        "trials": 0,
        "step [rad]": STEP,
        "goals [rad]": start.tolist(),
    }


def search(
    start: np.ndarray,
    legs: str,
    *,
    step: float,
    seed: int,
    generations: int = STAGE,
    reach: float | None = None,
) -> tuple[np.ndarray, float, float]:
    """CMA-ES, its covariance diagonal, on goals within the servos' end stops.

    Args:
        start: goals to begin with, ``(K, 18)`` [rad].
        legs: the damage.
        step: first standard deviation [rad].
        seed: of the search.
        generations: of `POPULATION` trials.
        reach: as for `reached`.

    Returns:
        the goals that got farthest, how far [m], and the last step [rad].
    """
    import cma

    from bns import models

    stops = models.robot("phantomx").ranges.T
    low, high = (np.tile(side, len(start)) for side in _within(stops, reach))
    options = {
        "popsize": POPULATION,
        "bounds": [low.tolist(), high.tolist()],
        "seed": seed % 2**31 + 1,  # 0 would be the clock
        "CMA_diagonal": True,
        "verbose": -9,
    }
    engine = cma.CMAEvolutionStrategy(start.ravel(), step, options)
    best, farthest = start, 0.0
    for _ in range(generations):
        tried = engine.ask()
        lists = [np.reshape(item, start.shape) for item in tried]
        ways = distances(lists, legs)
        engine.tell(tried, (-ways).tolist())
        if ways.max() > farthest:
            best, farthest = lists[int(ways.argmax())], float(ways.max())
    return best, farthest, float(engine.sigma)


def distances(lists: Sequence[np.ndarray], legs: str) -> np.ndarray:
    """How far lists of goals carry the robot, ``(N,)`` [m]."""
    damage = "" if legs == NONE else f"leg_raised:legs={legs},blend=1"
    return runs.ways(runs.walked(lists, damage=damage))


def _start(legs: str, reach: float | None) -> tuple[np.ndarray, float]:
    """The farthest of what is known to walk: by hand, or found by BNS."""
    from bns.models.phantomx import gait

    every = [gait.tripod(), *_found(runs.kept(legs)), *_found(runs.kept(NONE))]
    lists = [_within(goals, reach) for goals in every]
    ways = distances(lists, legs)
    return lists[int(ways.argmax())], float(ways.max())


def _within(goals: np.ndarray, reach: float | None) -> np.ndarray:
    return goals if reach is None else goals.clip(-reach, reach)


def _found(records: Sequence[RunRecord]) -> list[np.ndarray]:
    """The farthest walk of each run since the damage, if any."""
    lists = []
    for record in records:
        onset = max(int(record.damage_onset[0]), 0)
        for sent, ways in zip(record.sent, record["distance"], strict=True):
            lists.append(sent[onset + int(ways[onset:].argmax())])
    return lists


def _place(legs: str, reach: float | None) -> Path:
    name = legs if reach is None else f"{legs}-{reach:g}"
    return experiments.RUNS / f"hexapod-ceiling-{name}.json"
