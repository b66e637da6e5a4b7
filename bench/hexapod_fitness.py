"""Two forms of walking fitness: does the SNN tell the truth, does the robot walk?"""

import numpy as np

from bench import experiments, hexapod_runs
from bench.hexapod_gait import spread
from bench.result import Result
from bns.config import RunConfig
from bns.record import RunRecord

DOC = "repaired fitness: correlation of predicted and real displacement by trial 50"
BAR = ">= 0.8 and no zero-distance optimum"
LIMIT = 0.8
TRIALS, RUNS = 50, 3


def run(quick: bool) -> Result:
    """Each form, 3 undamaged runs of 50 trials; quick: one of 12.

    The figure is the median over runs of Pearson's correlation between the distance
    foreseen for the controller tried and the distance it went, over all trials.

    No zero-distance optimum is shown in the state at the end of each run: a controller
    that stands still may not be worth more than the population's best, and what
    evolution found has to move in the world.
    """
    configs = {
        form: hexapod_runs.undamaged(trials=TRIALS, replicates=RUNS, fitness=form)
        for form in ("repaired", "printed")
    }
    records = hexapod_runs.records(configs.values(), quick=quick)
    details: dict[str, object] = {}
    for form, config in configs.items():
        record = records[config.preset]
        used = hexapod_runs.small(config) if quick else config
        details[form] = _truth(record) | standing(used)
    repaired = details["repaired"]
    figure = repaired["correlation"]["median"]
    none = repaired["runs whose best is worth more than standing still"]
    return Result(
        figure=figure,
        unit="1",
        holds=None if quick else figure >= LIMIT and none == record.replicates,
        n=record.replicates,
        details=details,
    )


def _truth(record: RunRecord) -> dict[str, object]:
    foreseen, real = record["distance_predicted"], record["distance"]
    by_run = np.array(
        [np.corrcoef(a, b)[0, 1] for a, b in zip(foreseen, real, strict=True)]
    )
    half = record.trials // 2
    late = np.corrcoef(foreseen[:, half:].ravel(), real[:, half:].ravel())[0, 1]
    return {
        "correlation": spread(by_run),
        "correlation in the later half of the trials": round(float(late), 4),
        "distance in the last ten trials [m]": spread(real[:, -10:].mean(1)),
        "foreseen in the last ten trials [m]": spread(foreseen[:, -10:].mean(1)),
        "share of the last ten trials with the belly on the floor": round(
            float(record["fell"][:, -10:].mean()), 3
        ),
    }


def standing(config: RunConfig) -> dict[str, object]:
    """What standing still is worth inside the SNNs at the end of a batch.

    Args:
        config: of a batch that `experiments` has stored.
    """
    import torch

    from bns import files
    from bns.chromosome import Population
    from bns.walk.learner import WalkLearner

    learner = WalkLearner(
        [config] * config.replicates,
        replicates=range(config.replicates),
        onsets=[-1] * config.replicates,
    )
    learner.restore(files.read_npz(experiments.directory(config) / "state.npz"))
    evaluator, population = learner.evaluator, learner.population
    cost = evaluator.cost(learner.theta, population)
    still = Population(
        torch.zeros_like(population.genes[:, :1]), population.lengths[:, :1]
    )
    stands = evaluator.cost(learner.theta, still)[:, 0]
    best = cost.min(1).values
    poses = evaluator.poses(learner.theta, population)[:, :, -1, :2]
    ways = poses.square().sum(-1).sqrt()
    chosen = ways.gather(1, cost.argmin(1)[:, None])[:, 0]
    return {
        "runs whose best is worth more than standing still": int((best < stands).sum()),
        "cost of standing still": spread(stands.numpy()),
        "cost of the best": spread(best.numpy()),
        "foreseen distance of the best [m]": spread(chosen.numpy()),
    }
