"""The world of a configuration, with what its task tells it; model worlds."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from bns.errors import BnsError
from bns.experiment.config import RunConfig, WorldConfig
from bns.learners.bns.config import AdaptationConfig
from bns.storage import files
from bns.tasks import registry as tasks
from bns.worlds import registry as worlds
from bns.worlds.world import CountedWorld, World


def make_world(
    config: RunConfig, directory: Path | None = None, **others: Any
) -> World:
    """The world of a configuration.

    Args:
        config: says which, where the robot starts, and what is wrong with it.
        directory: where a static SNN world keeps its nets; None trains them anew.
        others: settings of the world that no configuration has, as `truth`.

    Raises:
        UnknownNameError: no such world, or it has no such setting.
        BnsError: a setting that the world refuses.
    """
    name = config.world.name
    settings: dict[str, Any] = {
        "robot": config.world.robot,
        "damage": config.world.damage,
        "reality": config.world.reality,
        **surroundings(config),
        **others,
    }
    if name == "static-snn":
        return worlds.make(name, nets=_nets(config, directory), **settings)
    return worlds.make(
        name,
        sample_dt=config.world.sample_dt,
        threads=config.threads,
        **settings,
    )


def surroundings(config: RunConfig) -> dict[str, Any]:
    """What the task of a configuration tells its world.

    Raises:
        UnknownNameError: no such task or world.
        BnsError: the world takes no such thing.
    """
    name = config.world.name
    found = tasks.of(config).surroundings()
    lacks = worlds.lacking(name, found)
    if lacks:
        fit = [item for item in worlds.names() if not worlds.lacking(item, found)]
        raise BnsError(
            f"The task {config.task.name!r} needs a world with {', '.join(lacks)}, "
            f"which {name!r} has not: give --world.name {' or '.join(fit)}."
        )
    return found


def make_models(config: RunConfig) -> list[CountedWorld]:
    """A model world for each replicate, see `PriorConfig`; none without a prior.

    A model has no damage, and its own share of evaluations.

    Raises:
        UnknownNameError: no such world.
        BnsError: a world that the task cannot be in, an effect it cannot have.
    """
    prior = config.prior
    if not prior.world:
        return []
    world = replace(config.world, name=prior.world, reality=prior.reality, damage=())
    others: dict[str, Any] = {"step": prior.step} if prior.step else {}
    made = make_world(replace(config, world=world), **others)
    return [CountedWorld(made, prior.evaluations) for _ in range(config.replicates)]


def _nets(config: RunConfig, directory: Path | None) -> Any:
    """Nets of the static SNN world, from the run's directory if they are there."""
    from bns.worlds.static_snn import StaticNets

    path = directory / "static_snn.npz" if directory else None
    if path and path.exists():
        return StaticNets.load(path)
    nets = _fitted(replace(config, adaptation=AdaptationConfig(), world=_bare(config)))
    if path:
        files.replace(path, nets.save)
    return nets


@lru_cache(maxsize=4)
def _fitted(config: RunConfig) -> Any:
    """Nets are dear: configurations of one batch share them."""
    from bns.experiment import static_snn

    return static_snn.nets_for(config)


def _bare(config: RunConfig) -> WorldConfig:
    """The world without what differs within a batch."""
    return WorldConfig(name=config.world.name, robot=config.world.robot)
