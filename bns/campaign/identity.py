"""What a configuration is, whatever it is called and wherever it stands in a file.

The identity of a configuration is a digest of the settings in which it differs from
the defaults. Replicates, seed, threads, device, the preset's name, the settings of
other tasks and learners and those of a watch that is not kept are no part of it. A
setting that is added later therefore changes no identity; a default that is changed
would leave them equal, so a store keeps whole configurations and refuses what does not
match them.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from hashlib import sha256
from typing import Any

from bns import seeding
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.validate import leaves
from bns.learners import registry
from bns.learners.bns.config import BNS_SECTIONS, AdaptationConfig
from bns.tasks import registry as tasks

TASK_SECTIONS = ("light", "walk")
"""sections that belong to the tasks of that kind alone"""

NO_PART = {"preset", "seed", "replicates", "record_replicates", "threads", "device"}


def settings(config: RunConfig) -> dict[str, Any]:
    """The settings that tell a configuration from the default one."""
    default = dict(leaves(replace(RunConfig(), settings=type(config.settings)())))
    return {
        name: value
        for name, value in _own(config)
        if name not in NO_PART and value != default[name]
    }


def foreign(config: RunConfig) -> list[str]:
    """Sections of the configuration that belong to other tasks and learners."""
    others = [name for name in TASK_SECTIONS if name != tasks.kind(config.task.name)]
    if config.learner != "bns":
        heeded = registry.get(config.learner).sections
        others += [name for name in BNS_SECTIONS if name not in heeded]
    return others


def _own(config: RunConfig) -> Iterator[tuple[str, Any]]:
    others, kind = foreign(config), tasks.kind(config.task.name)
    idle = {f"watch.{name}" for name in config.watch.idle(kind)}
    for name, value in leaves(config):
        if name.partition(".")[0] in others or name in idle:
            continue
        if config.learner == "bns" and kind in TASK_SECTIONS:
            # as it was called up to version 0.1: identities stay what they are
            name, value = _named_before(name, value, kind)
        yield name, value


def _named_before(name: str, value: Any, kind: str) -> tuple[str, Any]:
    """A setting of bns as version 0.1 had it, where `learner` said what is learned."""
    if name == "learner":
        return name, kind
    return (name, "simple") if name == "task.name" else (name, value)


def identity(config: RunConfig) -> str:
    """The configuration's name: 12 hexadecimal digits."""
    return digest(settings(config))


def core(config: RunConfig) -> str:
    """The identity without what runs of one batch may differ in."""
    bare = replace(config, adaptation=AdaptationConfig(), world=WorldConfig())
    return digest(settings(bare) | {"device": config.device})


def digest(content: Any, length: int = 12) -> str:
    """A digest of plain values, the same on every machine."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()[:length]


def batch_seed(seed: int, members: Iterable[tuple[str, int]]) -> int:
    """The seed of a batch, from who is in it.

    Args:
        seed: of the campaign.
        members: identity and first replicate of each configuration, sorted.
    """
    names = [part for identity, start in members for part in (identity, start)]
    return seeding.integer(seed, "campaign", *names)


def world_seed(seed: int) -> int:
    """The seed of worlds that are trained: one world for the whole campaign."""
    return seeding.integer(seed, "campaign-world")


def changed_default(wanted: RunConfig, stored: RunConfig) -> str:
    """A setting in which configurations of one identity differ; empty if none."""
    theirs = dict(_own(stored))
    for name, value in _own(wanted):
        if name not in NO_PART and theirs.get(name) != value:
            return f"{name} = {theirs.get(name)!r}, now {value!r}"
    return ""
