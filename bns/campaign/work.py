"""One batch, from its job to its bytes: what every engine runs."""

import time
from collections.abc import Callable
from dataclasses import replace
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
    from bns.experiment.run import facts, train_many
    from bns.experiment.world_factory import make_world

    configs = list(job.configs.values())
    mode = _mode(configs)
    records = train_many(
        configs,
        worlds=[make_world(_for_world(config, job.world_seed)) for config in configs],
        on_trial=lambda trial, step, trials: beat(trial + 1),
    )
    blocks = [
        Block(
            identity,
            config,
            job.start,
            int(facts(config, mode)["damage_onset"][0]),
            record.columns,
        )
        for (identity, config), record in zip(job.configs.items(), records, strict=True)
    ]
    made = {"seed": job.seed, "world_seed": job.world_seed, "mode": mode}
    return encode(Part(job.key, tuple(blocks), made | {"versions": packages()}))


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


def timed(
    content: dict[str, Any], beat: Beat = lambda trials: None
) -> tuple[bytes | str, float]:
    """What `attempt` gives, and the time it took [s]."""
    started = time.perf_counter()
    given = attempt(content, beat)
    return given, time.perf_counter() - started


def attempt(content: dict[str, Any], beat: Beat = lambda trials: None) -> bytes | str:
    """Run a job given as plain values; gives its bytes, or why it failed."""
    try:
        return run(Job.from_mapping(content), beat)
    except FAILURES as error:
        return describe(error)
