"""Two forms of walking fitness: does the SNN tell the truth, does the robot walk?"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.learning import experiments
from bench.result import Result, bench
from bench.walking import runs
from bench.walking.runs import spread
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord

if TYPE_CHECKING:
    from bns.learners.bns.learner import Bns

LIMIT = 0.8
TRIALS, RUNS = 50, 3
SOME = 30  # walks of a population that are tried


@bench(
    "repaired fitness: correlation of predicted and real displacement by trial 50",
    bar=">= 0.8 and no zero-distance optimum",
)
def hexapod_fitness(quick: bool) -> Result:
    """Each form, 3 undamaged runs of 50 trials; quick: one of 12.

    The figure is the median over runs of Pearson's correlation between the distance
    foreseen for the controller tried and the distance it went, over all trials up to
    the 50th. Both rise as a run goes on, which helps; the SNN errs most just after
    evolution has begun, which does not. So beside it: without the trials that came
    before evolution, over the later half, and what the SNN of the 50th trial foresees
    of walks it has not seen: of its own population, and of the other runs.

    No zero-distance optimum is shown in the state at the end of each run: a controller
    that stands still may not be worth more than the population's best, and what
    evolution found has to move in the world.
    """
    configs = {form: _config(form) for form in ("repaired", "printed")}
    records = runs.records(configs.values(), quick=quick)
    details: dict[str, object] = {}
    for form, config in configs.items():
        record = records[config.preset]
        used = runs.small(config) if quick else config
        learner = _at_the_end(used)
        details[form] = _truth(record) | unseen(learner, record) | standing(learner)
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


def _config(form: str) -> RunConfig:
    config = runs.undamaged("fitness", trials=TRIALS, fitness=form)
    return replace(config, replicates=RUNS)


def _truth(record: RunRecord) -> dict[str, object]:
    foreseen, real = record["distance_predicted"], record["distance"]
    begun, half = record.config.evolve_from, record.trials // 2
    return {
        "correlation": spread(_alike(foreseen, real)),
        "without the trials before evolution": spread(
            _alike(foreseen[:, begun:], real[:, begun:])
        ),
        "over the later half": spread(_alike(foreseen[:, half:], real[:, half:])),
        "distance in the last ten trials [m]": spread(real[:, -10:].mean(1)),
        "foreseen in the last ten trials [m]": spread(foreseen[:, -10:].mean(1)),
        "share of the last ten trials with belly or hip on the floor": round(
            float(record["fell"][:, -10:].mean()), 3
        ),
    }


def _alike(foreseen: np.ndarray, real: np.ndarray) -> np.ndarray:
    pairs = zip(foreseen, real, strict=True)
    return np.array([np.corrcoef(a, b)[0, 1] for a, b in pairs])


def unseen(learner: "Bns", record: RunRecord) -> dict[str, object]:
    """Correlations of walks that a run's SNN has not been trained on."""
    own = learner.population.genes[:, : SOME * 4 : 4].double().numpy()
    found = {"of its own population": [_told(learner, i, g) for i, g in enumerate(own)]}
    if learner.runs > 1:
        tried = record.sent[:, 4::6]
        others = [
            np.delete(tried, i, 0).reshape(-1, *tried.shape[2:])
            for i in range(learner.runs)
        ]
        found["of the other runs' trials"] = [
            _told(learner, i, g) for i, g in enumerate(others)
        ]
    return {f"correlation {k}": spread(np.array(v)) for k, v in found.items()}


def _told(learner: "Bns", run: int, goals: np.ndarray) -> float:
    """Correlation of what a run's SNN foresees of walks `(N, K, 18)` and the world."""
    import torch

    from bns.evolution.chromosome import Population
    from bns.tasks import walk

    genes = torch.from_numpy(np.ascontiguousarray(goals)).float()[None]
    lengths = torch.full(genes.shape[:2], genes.shape[2])
    poses = learner.problem.evaluator.poses(
        learner.theta[run : run + 1], Population(genes, lengths)
    )
    foreseen = walk.distance(poses[0].double().numpy())
    real = runs.ways(runs.walked(goals))
    return float(np.corrcoef(foreseen, real)[0, 1])


def _at_the_end(config: RunConfig) -> "Bns":
    """The learner of a batch that `experiments` has stored, after its last trial."""
    from bns.learners.bns.learner import Bns
    from bns.storage import arrays

    count = config.replicates
    learner = Bns([config] * count, replicates=range(count), onsets=[-1] * count)
    learner.restore(arrays.read_npz(experiments.directory(config) / "state.npz"))
    return learner


def standing(learner: "Bns") -> dict[str, object]:
    """What standing still is worth inside the SNNs."""
    import torch

    from bns.evolution.chromosome import Population

    evaluator, population = learner.problem.evaluator, learner.population
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
