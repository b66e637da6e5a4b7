"""How soon a hexapod learns an adequate gait, undamaged."""

import numpy as np

from bench import hexapod_runs, solving
from bench.result import Result
from bns import stats

DOC = "trials until the hexapod walks as far as the tripod gait made by hand"
BAR = "median <= 100 trials, stretch 40"
LIMIT, STRETCH = 100, 40


def run(quick: bool) -> Result:
    """30 runs of 100 trials; quick: one of 12.

    The tripod's distance is the preset's `walk.adequate`; `hexapod-tripod` measures it.
    """
    config = hexapod_runs.undamaged()
    (record,) = hexapod_runs.records([config], quick=quick).values()
    waits = solving.waits(stats.trials_to_solve(record))
    ways = record["distance"]
    late = ways[:, -10:]
    median = waits["median"]
    return Result(
        figure=median if median is not None else 10.0 * record.trials,
        unit="trials",
        holds=None if quick else median is not None and median <= LIMIT,
        n=record.replicates,
        details={
            "trials to an adequate gait": waits,
            "within the stretch": solving.solved_within(record, STRETCH),
            "adequate [m]": record.config.walk.adequate,
            "distance, falls counted, farthest of a run [m]": spread(ways.max(1)),
            "distance in the last ten trials [m]": spread(np.median(late, axis=1)),
            "share of the last ten trials with the belly on the floor": round(
                float(record["fell"][:, -10:].mean()), 3
            ),
        },
    )


def spread(values: np.ndarray) -> dict[str, float]:
    """Median and range over runs."""
    return {
        "median": round(float(np.median(values)), 4),
        "least": round(float(values.min()), 4),
        "most": round(float(values.max()), 4),
    }
