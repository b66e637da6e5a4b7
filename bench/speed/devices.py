"""The learner on a GPU beside the same learner on the processor."""

import time
from dataclasses import replace
from statistics import median
from typing import Any

import torch

from bench.result import Result, bench
from bench.speed.learners import by_trial, drawn, in_network
from bns import presets
from bns.errors import BnsError
from bns.evolution.chromosome import Population
from bns.experiment.config import RunConfig

CARD = "cuda"
TASKS = ("khepera-simple", "khepera-light", "hexapod-walk")
RUNS, MANY = 30, 300  # in a batch
WARM, COUNTED = 2, 5  # trials
CLOSE = 1e-3  # of costs, relative; float32


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
