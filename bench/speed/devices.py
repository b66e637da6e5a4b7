"""The learner on a GPU beside the same on the processor: seconds, and trials."""

import time
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np
import torch

from bench.learning import experiments
from bench.result import Result, bench
from bench.speed.learners import by_trial, drawn, in_network
from bench.walking import runs
from bns import presets, stats
from bns.errors import BnsError
from bns.evolution.chromosome import Population
from bns.experiment.config import RunConfig

CARD = "cuda"
TASKS = ("khepera-simple", "khepera-light", "hexapod-walk")
RUNS, MANY = 30, 300  # in a batch
WARM, COUNTED = 2, 5  # trials
CLOSE = 1e-3  # of costs, relative; float32
DAMAGE = "left-20"  # of `experiments.DAMAGES`
WALKED, SMALL = 50, 4  # trials of walkers; in a quick look
THREADS = 6  # of each of the three that run side by side
UNLIKE = 0.01  # p below which the two devices learn differently


@bench(
    "seconds of learning a trial, processor over GPU, least of three tasks, 30 runs",
    bar="none: printed",
)
def learner_device(quick: bool) -> Result:
    """Three presets on all cores of the processor and on the GPU beside it.

    Before anything is timed, the same controllers in the same networks have to cost
    the same on both. quick: `khepera-simple` alone.
    """
    if not torch.cuda.is_available():
        raise BnsError(f"learner-device needs a GPU: torch here has no {CARD!r}")
    details: dict[str, Any] = {
        "GPU": torch.cuda.get_device_name(),
        "threads of the processor": torch.get_num_threads(),
        "costs apart, relative": apart(),
    }
    if details["costs apart, relative"] > CLOSE:
        raise BnsError(f"the two devices do not agree: {details}")
    sizes = [(TASKS[0], RUNS)]
    if not quick:
        sizes += [(TASKS[0], MANY), *((name, RUNS) for name in TASKS[1:])]
    ratios = []
    for name, size in sizes:
        config = presets.load(name)
        taken = {device: learning(config, size, device) for device in (CARD, "cpu")}
        details[f"{name}, {size} runs [s a trial]"] = taken
        print(name, size, taken, flush=True)  # the rest takes long
        if size == RUNS:
            ratios.append(taken["cpu"] / taken[CARD])
    return Result(
        figure=round(min(ratios), 3),
        unit="x",
        holds=None,
        n=COUNTED * len(sizes),
        details=details,
    )


@bench(
    "least p of trials to solve and to recover, learned on a GPU or a processor",
    bar="none: printed (>= 0.01: as two seeds)",
)
def learned_on_gpu(quick: bool) -> Result:
    """30 robots of `khepera-simple` lose 20 % of a wheel's speed, on each device; and
    ten of `hexapod-nominal` walk, learning on the GPU. quick: six and one, few trials.
    """
    if not torch.cuda.is_available():
        raise BnsError(f"learned-on-gpu needs a GPU: torch here has no {CARD!r}")
    wheeled = experiments.damaged(DAMAGE)
    wheeled = experiments.shortened(wheeled) if quick else wheeled
    walking = runs.undamaged("gpu", trials=WALKED, preset=runs.OWN)
    walking = replace(runs.small(walking), trials=SMALL) if quick else walking
    configs = [
        replace(wheeled, preset=f"{DAMAGE}-{device}", device=device, threads=THREADS)
        for device in (CARD, "cpu")
    ]
    configs.append(replace(walking, device=CARD, threads=THREADS))
    found = experiments.records(configs)
    card, processor, walked = (found[config.preset] for config in configs)
    details: dict[str, Any] = {"GPU": torch.cuda.get_device_name()}
    least = 1.0
    for name, trials in (
        ("solve", stats.trials_to_solve),
        ("recover", stats.trials_to_recover),
    ):
        pair = trials(card), trials(processor)
        p = float(stats.mann_whitney(*pair))
        each = dict(zip((CARD, "cpu"), map(experiments.waits, pair), strict=True))
        details[f"trials to {name}"] = {**each, "p": round(p, 4)}
        least = min(least, p)
    hit = runs.adequate(walked, runs.by_hand())
    details["walkers on the GPU"] = {
        "trials to the tripod's distance in its time": experiments.waits(
            experiments.first(hit)
        ),
        "last ten trials, median [m]": round(
            float(np.median(walked["distance"][:, -10:])), 3
        ),
    }
    return Result(
        figure=round(least, 4),
        unit="p",
        holds=None if quick else least >= UNLIKE,
        n=card.replicates + processor.replicates + walked.replicates,
        details=details,
    )


def learning(config: RunConfig, size: int, device: str) -> float:
    """Seconds that evolution and training of a trial take, median; the world's are not
    counted.

    Args:
        config: what is learned.
        size: runs in the batch.
        device: torch device of the learner.
    """
    from bns.experiment.batch import Batch, resolve
    from bns.experiment.world_factory import make_world

    threads = torch.get_num_threads()
    config = replace(config, replicates=size, device=device, threads=threads)
    config, _ = resolve(config)
    batch = Batch([config], [make_world(config)])

    def now() -> float:
        if device == CARD:
            torch.cuda.synchronize()  # after all that the device was given is done
        return time.perf_counter()

    taken = list(by_trial(batch, WARM + COUNTED, now))[WARM:]
    return round(median(evolution + training for evolution, _, training in taken), 4)


def apart() -> float:
    """Largest difference of the costs of one population, relative to the largest."""
    here, there = in_network(), in_network(CARD)
    population, theta = drawn(here)
    genes, lengths = population.genes.to(CARD), population.lengths.to(CARD)
    ours = here.cost(theta, population)
    theirs = there.cost(theta.to(CARD), Population(genes, lengths)).cpu()
    return float((ours - theirs).abs().max() / ours.abs().max())
