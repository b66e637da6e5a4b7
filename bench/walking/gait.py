"""Gaits: what the robot stands on, tripods, and walks learned and regained.

They are regained after legs were raised, with a sliding window of 300 patterns.
"""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from bench.learning import experiments
from bench.result import Result, bench
from bench.walking import ceiling, runs
from bench.walking.runs import spread
from bns.experiment.record import RunRecord

PARTS = ("foot", "tibia", "femur", "belly")
EVERY = 4  # steps of the physics


def shares(lists: Sequence[np.ndarray]) -> np.ndarray:
    """Share of the floor's push on each of `PARTS` over whole trials, ``(N, 4)``.

    Args:
        lists: goals, each ``(K, 18)`` [rad], walked undamaged.
    """
    from bench.walking import runs

    world, commands = runs.standing_by(lists)
    return np.array([_shares(world, plan) for plan in world.plan(commands)])


def _shares(world, plan) -> np.ndarray:
    import mujoco

    (done,) = world.motions([plan])
    model = plan.job.pieces[0].compiled.model
    data, total = mujoco.MjData(model), np.zeros(len(PARTS))
    whole = mujoco.mjtState.mjSTATE_FULLPHYSICS
    for state, control in zip(
        done.states[::EVERY], done.control[::EVERY], strict=False
    ):
        mujoco.mj_setState(model, data, state, whole)
        data.ctrl[:] = control
        mujoco.mj_forward(model, data)
        total += _pushes(model, data)
    return total / total.sum()


def _pushes(model, data) -> np.ndarray:
    """Normal force of the floor on each of `PARTS` [N]."""
    import mujoco

    found, force = np.zeros(len(PARTS)), np.zeros(6)
    for number, contact in enumerate(data.contact):
        bodies = model.geom_bodyid[contact.geom]
        if bodies.min() > 0:
            continue
        mujoco.mj_contactForce(model, data, number, force)
        name = model.geom(int(contact.geom[bodies.argmax()])).name
        found[[part in name for part in PARTS].index(True)] += force[0]
    return found


LIMIT, STRETCH = 100, 40
LATE = 10  # trials at the end of a run that say how far it has come


@bench(
    "trials until the hexapod walks as far as the best tripod made by hand in its time",
    bar="median <= 100 trials, stretch 40",
)
def hexapod_gait(quick: bool) -> Result:
    """30 runs of 100 trials; quick: one of 12.

    Adequate is a trial in which the robot gets as far as the tripod gait within the
    time that the tripod gait takes; one that takes longer counts in proportion.
    Beside it: as far in as many commands, whatever the time, and how far walks get.
    """
    record = runs.walking(quick=quick)
    hand = runs.by_hand()
    timed = experiments.first(runs.adequate(record, hand))
    told = experiments.first(record["distance"] >= hand.distance)
    waits = experiments.waits(timed)
    median = waits["median"]
    return Result(
        figure=median if median is not None else 10.0 * runs.ONSET,
        unit="trials",
        holds=None if quick else median is not None and median <= LIMIT,
        n=len(timed),
        details={
            "tripod by hand": dict(hand._asdict()),
            "trials to its distance in its time": waits,
            "within the stretch": int((timed <= STRETCH).sum()),
            "trials to its distance in as many commands": experiments.waits(told),
            "at the end": at_the_end(record),
        },
    )


def at_the_end(record: RunRecord) -> dict[str, object]:
    """How far, how fast and on what the robot walks in the last ten trials."""
    ways, late = record["distance"], slice(-LATE, None)
    far = np.median(ways[:, late], axis=1)
    speed = (ways / record["seconds"])[:, late].mean(1)
    loads = shares([run[-1] for run in record.sent]).mean(0)
    return {
        "trials": record.trials,
        "farthest of a run [m]": spread(ways.max(1)),
        "last ten trials [m]": spread(far),
        "last ten trials [m/s]": spread(speed),
        "ceiling [m]": ceiling.ceilings("none"),
        "share of the ceiling": ceiling.shares(far, "none"),
        "share of the last ten trials with belly or hip on the floor": round(
            float(record["fell"][:, late].mean()), 3
        ),
        "share of the weight on feet, shins, thighs, belly": [
            round(float(load), 3) for load in loads
        ],
    }


COMMANDS = 11
LONGEST = 1.5  # [s] of a command
STRIDES, LIFTS = (0.14, 0.16, 0.18), (0.045, 0.06)
REACHES, HEIGHTS = (0.12, 0.13, 0.14, 0.15), (0.12, 0.13, 0.14)


@bench(
    "distance of the tripod gait made by hand, eleven commands of the hexapod",
    bar="the farthest of a grid of such gaits",
)
def hexapod_tripod(quick: bool) -> Result:
    """`gait.BEST` against every gait of the grid that legs can reach.

    The figure is the distance of `gait.BEST` [m]; the bar holds where none of the grid
    goes more than 2 % farther without a fall or a collision of its own parts.
    """
    from bns.models.phantomx import gait

    grid = [gait.Tripod(*item) for item in product(STRIDES, LIFTS, REACHES, HEIGHTS)]
    gaits = [gait.BEST, *(grid[::30] if quick else grid)]
    trials = _walked(gaits)
    far = {
        item: float(np.hypot(*trial.poses_world[-1, :2]))
        for item, trial in trials.items()
        if not (trial.outcome.fell or trial.outcome.collided)
    }
    best, own = max(far, key=far.__getitem__), trials[gait.BEST]
    details = {
        "gait": dict(gait.BEST._asdict()),
        "end x, y [m], yaw [rad]": [round(float(v), 4) for v in own.poses_world[-1]],
        "seconds": round(float(own.times[-1]), 3),
        "metres per second": round(far[gait.BEST] / float(own.times[-1]), 4),
        "farthest": {**best._asdict(), "distance": round(far[best], 4)},
        "median of the grid": round(float(np.median(list(far.values()))), 4),
    }
    return Result(
        figure=round(far[gait.BEST], 4),
        unit="m",
        holds=far[best] <= 1.02 * far[gait.BEST],
        n=len(trials),
        details=details,
    )


def _walked(gaits: list) -> dict:
    """A trial of each gait that the legs can do."""
    from bns.errors import BnsError
    from bns.models.phantomx.gait import tripod
    from bns.worlds import registry
    from bns.worlds.trial import Channel, Commands

    world = registry.make("hexapod")
    channels = tuple(Channel(*item) for item in world.model.channels)
    done, lists = [], []
    for item in dict.fromkeys(gaits):
        try:
            goals = tripod(item, commands=COMMANDS)
        except BnsError:
            continue
        done.append(item)
        lists.append(Commands(goals, np.full(COMMANDS, LONGEST), channels))
    return dict(zip(done, world.run(lists), strict=True))


BARS = (0.5, 0.75, 0.9)  # of the damage's ceiling, whatever the robot did before
MILD, LIMIT_MILD, LIMIT_SEVERE = ("type0", "type1", "type3"), 30, 46


@bench(
    "worst median of trials until a damaged hexapod walks 90 % as far as before",
    bar="median <= 30 trials for types 0, 1, 3 and <= 46 for types 2, 5; window 300",
)
def recover_hexapod(quick: bool) -> Result:
    """Damage from trial 100 of 150; quick: one run of 12 trials.

    The runs of all types are those of `hexapod-gait` up to the damage. The figure is
    that of the window, ten runs a type; beside it, from the same undamaged runs on,
    what forgetting by evidence comes to (`watch.forget`), and the preset
    `hexapod-recover`, thirty runs a type.
    """
    records, others, ours = (
        runs.recovering(kind, quick=quick) for kind in ("window", "forget", "own")
    )
    hand = runs.by_hand()
    found: dict[str, object] = {}
    medians, holds = [], True
    for legs, record in records.items():
        row = found[legs] = recovery(legs, record, hand)
        row["with watch.forget"] = {
            **recovery(legs, others[legs], hand),
            "trials until it forgot": experiments.waits(_forgot(others[legs])),
        }
        row["hexapod-recover"] = recovery(legs, ours[legs], hand)
        median = row["median"]
        limit = LIMIT_MILD if legs in MILD else LIMIT_SEVERE
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


def recovery(legs: str, record: RunRecord, hand: runs.Hand) -> dict[str, Any]:
    """Trials until robots walk again after a damage, by each yardstick."""
    onset, ways = int(record.damage_onset[0]), record["distance"]
    late = np.median(ways[:, -runs.BEFORE :], axis=1)
    enough = runs.SHARE * runs.before(record)
    adequate = runs.adequate(record, hand)
    return {
        **experiments.waits(runs.trials_to_regain(record)),
        "until adequate again": experiments.waits(
            experiments.first(adequate[:, onset:])
        ),
        "as far undamaged, from the start": experiments.waits(
            experiments.first(ways[:, :onset] >= enough[:, None])
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
            f"{bar:.0%}": experiments.waits(experiments.first(ways >= bar * most))
            for bar in BARS
        }
        for name, most in ceiling.ceilings(legs).items()
    }
