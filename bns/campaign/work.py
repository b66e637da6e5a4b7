"""One batch, from its job to its bytes: what every engine runs."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from bns.campaign.part import Block, Part, encode
from bns.campaign.plan import Job
from bns.experiment.config import RunConfig

Beat = Callable[[int], None]


def run(job: Job, beat: Beat = lambda trials: None) -> bytes:
    """Train the batch and give the bytes of its part.

    Args:
        job: what to run.
        beat: called with the number of trials done, after each.

    Raises:
        BnsError: a setting that is not allowed.
    """
    from bns.experiment.run import facts

    if job.trunk:
        columns, mode = _from_trunk(job, beat)
    else:
        columns, mode = _together(job, beat)
    if job.grows:
        return b""
    blocks = [
        Block(
            identity,
            config,
            job.start,
            int(facts(config, mode)["damage_onset"][0]),
            columns[identity],
        )
        for identity, config in job.configs.items()
    ]
    return encode(Part(job.key, tuple(blocks), made(job, mode)))


def made(job: Job, mode: str) -> dict[str, Any]:
    """From what a batch is made: seeds, mode, and the code."""
    from bns.experiment.versions import REVISION

    return {
        "seed": job.seed,
        "world_seed": job.world_seed,
        "mode": mode,
        "versions": packages(),
        "commit": job.commit,
        "revision": REVISION,
    }


Columns = Mapping[str, Mapping[str, Any]]


def _together(job: Job, beat: Beat) -> tuple[Columns, str]:
    """Train all configurations as one batch; figures of each, by identity."""
    from bns.experiment.run import train_many
    from bns.experiment.world_factory import make_world

    configs = list(job.configs.values())
    mode = _mode(configs)
    records = train_many(
        configs,
        worlds=[make_world(_for_world(config, job.world_seed)) for config in configs],
        on_trial=lambda trial, step, trials: beat(trial + 1),
    )
    named = zip(job.configs, records, strict=True)
    return {identity: record.columns for identity, record in named}, mode


def _from_trunk(job: Job, beat: Beat) -> tuple[Columns, str]:
    """Train one configuration from its trunk on, or the trunk itself."""
    from bns.campaign import trunk
    from bns.experiment.validate import check
    from bns.experiment.world_factory import make_world

    ((identity, config),) = job.configs.items()
    _mode([check(config)])
    path, length = Path(job.trunk), trunk.shared(config)
    begun = trunk.read(path, seed=config.seed, trials=length)
    if job.grows and begun is not None:
        return {}, begun.mode
    world = make_world(_for_world(config, job.world_seed))
    until = length if job.grows else config.trials
    found = trunk.train(config, world, until=until, begun=begun, beat=beat)
    if job.grows:
        trunk.write(path, found)
    return {identity: found.columns}, found.mode


def packages() -> dict[str, str]:
    """Versions of what can move a result."""
    from bns import __version__
    from bns.experiment.versions import package

    moving = ("mujoco", "numpy", "torch")
    return {"bns": __version__} | {name: package(name) for name in moving}


def _mode(configs: list[RunConfig]) -> str:
    """Compiled or eager; what was compiled for other batches is forgotten.

    Without that, the compiler's cache fills over the batches of a process, and the
    last ones would silently run uncompiled.
    """
    from bns.experiment.batch import resolve

    modes = {resolve(config)[1] for config in configs}
    mode = modes.pop()
    if mode == "compiled":
        import torch

        torch._dynamo.reset()
    return mode


def _for_world(config: RunConfig, seed: int) -> RunConfig:
    """What a world depends on, so that all of a campaign meet the same nets."""
    plain = RunConfig()
    return replace(
        config,
        evolution=plain.evolution,
        snn=plain.snn,
        adaptation=plain.adaptation,
        trials=plain.trials,
        replicates=1,
        seed=seed,
        threads=1,
    )


def describe(error: BaseException) -> str:
    """An error as a reason to keep."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"[:500]


FAILURES: tuple[type[Exception], ...] = (
    ArithmeticError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)
"""what a batch may raise without taking the campaign with it"""


PULSE = 20.0  # [s]
BUSY = 0.05  # of that time: a process that computes less waits for something


def timed(
    content: dict[str, Any], beat: Beat = lambda trials: None
) -> tuple[bytes | str, float]:
    """What `attempt` gives, and the time it took [s]."""
    started = time.perf_counter()
    with pulsing(beat) as told:
        given = attempt(content, told)
    return given, time.perf_counter() - started


@contextmanager
def pulsing(beat: Beat, *, every: float = PULSE) -> Iterator[Beat]:
    """A beat that is repeated while this process computes: a learner may think in its
    model for longer than an engine waits for a trial.

    Args:
        beat: called with the number of trials done.
        every: time between two looks at how much was computed [s].
    """
    done, over = 0, threading.Event()

    def told(trials: int) -> None:
        nonlocal done
        done = trials
        beat(trials)

    def look() -> None:
        before = time.process_time()
        while not over.wait(every):
            now = time.process_time()
            if now - before > BUSY * every:
                beat(done)
            before = now

    looking = threading.Thread(target=look, daemon=True)
    looking.start()
    try:
        yield told
    finally:
        over.set()
        looking.join()


def attempt(content: dict[str, Any], beat: Beat = lambda trials: None) -> bytes | str:
    """Run a job given as plain values; gives its bytes, or why it failed."""
    try:
        return run(Job.from_mapping(content), beat)
    except FAILURES as error:
        return describe(error)
