"""How soon a hexapod learns an adequate gait, undamaged."""

import numpy as np

from bench import hexapod_ceiling, hexapod_loads, hexapod_runs, solving
from bench.hexapod_runs import spread
from bench.result import Result
from bns.record import RunRecord

DOC = (
    "trials until the hexapod walks as far as the best tripod made by hand in its time"
)
BAR = "median <= 100 trials, stretch 40"
LIMIT, STRETCH = 100, 40
LATE = 10  # trials at the end of a run that say how far it has come


def run(quick: bool) -> Result:
    """30 runs of 100 trials; quick: one of 12.

    Adequate is a trial in which the robot gets as far as the tripod gait within the
    time that the tripod gait takes; one that takes longer counts in proportion. Beside
    it: as far in as many commands, whatever the time.
    """
    record, hand = hexapod_runs.walking(quick=quick), hexapod_runs.by_hand()
    timed = first(hexapod_runs.in_time(record, hand.seconds) >= hand.distance)
    ways = record["distance"]
    late = np.median(ways[:, -LATE:], axis=1)
    waits = solving.waits(timed)
    median = waits["median"]
    ceiling = hexapod_ceiling.known("none")
    return Result(
        figure=median if median is not None else 10.0 * record.trials,
        unit="trials",
        holds=None if quick else median is not None and median <= LIMIT,
        n=record.replicates,
        details={
            "tripod by hand": dict(hand._asdict()),
            "trials to its distance in its time": waits,
            "within the stretch": int((timed <= STRETCH).sum()),
            "trials to its distance in as many commands": solving.waits(
                first(ways >= hand.distance)
            ),
            "distance, farthest of a run [m]": spread(ways.max(1)),
            "distance in the last ten trials [m]": spread(late),
            "metres per second in the last ten trials": spread(
                (ways / record["seconds"])[:, -LATE:].mean(1)
            ),
            "ceiling [m]": ceiling,
            "share of the ceiling in the last ten trials": spread(late / ceiling)
            if ceiling
            else None,
            **on_the_floor(record),
        },
    )


def first(hit: np.ndarray) -> np.ndarray:
    """Number of the first trial that did it, counted from 1; inf = none, ``(R,)``."""
    return np.where(hit.any(1), hit.argmax(1) + 1.0, np.inf)


def on_the_floor(record: RunRecord) -> dict[str, object]:
    """What touches the floor in the last trial of each run, and how often."""
    lying = float(record["fell"][:, -LATE:].mean())
    walks = [run[-1] for run in record.sent]
    shares = hexapod_loads.shares(walks)
    return {
        "last ten trials in which belly or hip touched the floor": round(lying, 3),
        "share of the weight on feet, shins, thighs, belly": [
            round(float(share), 3) for share in shares.mean(0)
        ],
    }
