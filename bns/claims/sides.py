"""Sides of comparisons as configurations, as far as what they need exists."""

import re
from dataclasses import replace

from bns import presets
from bns.campaign.file import Member
from bns.campaign.settings import flatten, with_settings
from bns.claims.claim import Cell, content
from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import EvolutionConfig, RunConfig

QUICK_TRIALS, QUICK_DIVISOR = 12, 5


def member(investigation: str, side: str, *, world: str, quick: bool = False) -> Member:
    """A side as a member of a campaign.

    Args:
        investigation: "A" to "D".
        side: names of pieces.
        world: key of the investigation's `worlds`: "mujoco" or "static-snn".
        quick: a small and short version, for a look that takes seconds.

    Raises:
        BnsError: a preset, piece, setting or effect that does not exist (yet).
    """
    from bns.experiment.batch import check_world

    data = content(investigation)
    if world not in data["worlds"]:
        raise BnsError(f"no world like {world!r} for this task")
    if data["preset"] not in presets.names():
        raise BnsError(f"no preset {data['preset']!r}")
    settings = flatten(data["settings"], f"claims of {investigation}")
    for name in side.split():
        if name not in data["pieces"]:
            raise UnknownNameError(f"piece of {investigation}", name, data["pieces"])
        settings |= flatten(data["pieces"][name], name)
    settings["world.name"] = data["worlds"][world]
    base = replace(
        presets.load(data["preset"]),
        seed=0,
        replicates=1,
        record_replicates=0,
        threads=1,
        compiled="auto",
    )
    config = with_settings(base, settings)
    check_world(config)
    config = shrunk(config) if quick else config
    return Member(f"{investigation}: {side}", config, settings)


def missing(investigation: str, cell: Cell, *, world: str) -> str:
    """Why a cell cannot run; empty where it can."""
    for side in cell.sides:
        try:
            member(investigation, side, world=world)
        except BnsError as error:
            return str(error).partition(" Available:")[0].rstrip(".")
    return ""


def shrunk(config: RunConfig) -> RunConfig:
    """A fifth of the trials, and little evolution and training in them."""
    trials = max(QUICK_TRIALS, config.trials // QUICK_DIVISOR)
    evolution = replace(
        config.evolution,
        population=min(50, config.evolution.population),
        generations=min(30, config.evolution.generations),
        tournament=min(config.evolution.tournament, EvolutionConfig().tournament),
    )
    damage = tuple(
        re.sub(r"@(\d+)", lambda m: f"@{int(m[1]) // QUICK_DIVISOR}", text)
        for text in config.world.damage
    )
    return replace(
        config,
        trials=trials,
        evolution=evolution,
        snn=replace(config.snn, epochs=min(100, config.snn.epochs)),
        world=replace(config.world, damage=damage),
        compiled="no",
    )
