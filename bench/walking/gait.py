"""How soon a hexapod learns an adequate gait, undamaged."""

import numpy as np

from bench.learning import solving
from bench.result import Result, bench
from bench.walking import ceiling, runs
from bench.walking import loads as hexapod_loads
from bench.walking.runs import spread
from bns.experiment.record import RunRecord

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
    timed = solving.first(runs.adequate(record, hand))
    told = solving.first(record["distance"] >= hand.distance)
    waits = solving.waits(timed)
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
            "trials to its distance in as many commands": solving.waits(told),
            "at the end": at_the_end(record),
        },
    )


def at_the_end(record: RunRecord) -> dict[str, object]:
    """How far, how fast and on what the robot walks in the last ten trials."""
    ways, late = record["distance"], slice(-LATE, None)
    far = np.median(ways[:, late], axis=1)
    share = ceiling.share(far, "none")
    speed = (ways / record["seconds"])[:, late].mean(1)
    loads = hexapod_loads.shares([run[-1] for run in record.sent]).mean(0)
    return {
        "trials": record.trials,
        "farthest of a run [m]": spread(ways.max(1)),
        "last ten trials [m]": spread(far),
        "last ten trials [m/s]": spread(speed),
        "ceiling [m]": ceiling.known("none"),
        "share of the ceiling": None if share is None else spread(share),
        "share of the last ten trials with belly or hip on the floor": round(
            float(record["fell"][:, late].mean()), 3
        ),
        "share of the weight on feet, shins, thighs, belly": [
            round(float(load), 3) for load in loads
        ],
    }
