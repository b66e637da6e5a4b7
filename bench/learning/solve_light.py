"""Trials until the undamaged Khepera III circles the lamp (table 5.19).

What counts as circling is `bns.tasks.light.LightTask.solved`; the trial is one, from a
random start, as the dissertation judged its robot runs. Beside it stands the count for
half a round in the same time, which the slowest robot on the goal radius does not make.
"""

import numpy as np

from bench.learning import experiments, light_runs, solving
from bench.result import Result, bench
from bns import stats
from bns.experiment.record import RunRecord
from bns.tasks.light import LampGoal

MEDIAN, FEWEST, LIMIT = 6, 27, 15
HALF = 180.0  # [deg]


@bench(
    "median trials until the robot circles the lamp, undamaged, settings T5.19",
    bar="median <= 6 trials, >= 27 of 30 runs within 15",
)
def solve_light(quick: bool) -> Result:
    """30 runs of the preset `khepera-light`, 15 trials each."""
    config = light_runs.undamaged()
    record = experiments.records([config], quick=quick)[config.preset]
    waits = solving.waits(stats.trials_to_solve(record))
    median, within = waits["median"], solving.solved_within(record, LIMIT)
    good = median is not None and median <= MEDIAN and within >= FEWEST
    last = record["solved"][:, -5:].mean()
    return Result(
        figure=median if median is not None else float(record.trials + 1),
        unit="trials",
        holds=None if quick else good,
        n=record.replicates,
        details={
            "solved within 15": within,
            "of them with half a round": int(half_rounds(record).any(1).sum()),
            "solved trials among the last five": round(float(last), 3),
            "stopped at the lamp among the last five": round(
                float((record["lamp_stops"][:, -5:] > 0).mean()), 3
            ),
            **waits,
        },
    )


def half_rounds(record: RunRecord) -> np.ndarray:
    """Trials that solved the task and got half round the lamp, ``(R, T)`` bool."""
    light = record.config.light
    lamp = LampGoal.of(light).lamp
    way = record.poses[..., -light.circle_cycles - 1 :, :2] - np.asarray(lamp)
    azimuth = np.unwrap(np.arctan2(way[..., 1], way[..., 0]))
    far = np.abs(azimuth[..., -1] - azimuth[..., 0]) >= np.radians(HALF)
    return (record["solved"] > 0) & far
