"""Sides of comparisons as configurations, as far as what they need exists."""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from bns import presets
from bns.campaign.file import Member
from bns.campaign.settings import flatten, with_settings
from bns.claims import provenance
from bns.claims.claim import Cell, claims, content
from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import RunConfig
from bns.learners.bns.config import EvolutionConfig
from bns.worlds.damage import Damage

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
    config, settings = _whole(investigation, side, world)
    config = shrunk(config) if quick else config
    return Member(f"{investigation}: {side}", config, settings)


@cache
def _whole(
    investigation: str, side: str, world: str
) -> tuple[RunConfig, Mapping[str, Any]]:
    """A side's configuration, and the settings that make it."""
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
    enough = trials_needed(investigation, side, onset=onset(config))
    if enough and enough < config.trials:
        settings["trials"] = enough
        config = replace(config, trials=enough)
    return config, settings


def onset(config: RunConfig) -> int:
    """First damaged trial, counted from 0; -1 = none."""
    return Damage.parse(config.world.damage).first_trial


def trials_needed(investigation: str, side: str, *, onset: int) -> int:
    """Trials after which a side has shown all that is asked of it; 0 = all it has.

    A side of which only is asked whether it recovers (or solves the task) within k
    trials need not go on after those.

    Args:
        investigation: "A" to "D".
        side: names of pieces.
        onset: first damaged trial, counted from 0; -1 = there is no damage.
    """
    most = 0
    for cell in _cells(investigation, side):
        counted = {"recover": max(onset, 0), "solve": 0}.get(cell.measure)
        if counted is None or cell.b:
            return 0
        limit = cell.at_most if cell.at_most is not None else (cell.at_least or 1) - 1
        most = max(most, counted + int(limit))
    return most


@cache
def _cells(investigation: str, side: str) -> tuple[Cell, ...]:
    """All comparisons of an investigation in which a side is."""
    return tuple(
        cell
        for claim in claims().values()
        if claim.investigation == investigation
        for cell in claim.cells
        if side in cell.sides
    )


@cache
def settings_of(investigation: str, side: str, world: str) -> Mapping[str, Any]:
    """All settings of a side, defaults included; see `bns.claims.provenance`.

    Args:
        investigation: "A" to "D".
        side: names of pieces.
        world: key of the investigation's `worlds`.

    Raises:
        BnsError: as `member`.
    """
    config, _ = _whole(investigation, side, world)
    return provenance.resolved(config, content(investigation)["ignored"])


@cache
def digest_of(investigation: str, side: str, world: str) -> str:
    """The digest of `settings_of`.

    Args:
        investigation: "A" to "D".
        side: names of pieces.
        world: key of the investigation's `worlds`.

    Raises:
        BnsError: as `member`.
    """
    return provenance.of(settings_of(investigation, side, world))


def missing(investigation: str, cell: Cell, *, world: str) -> str:
    """Why a cell cannot run; empty where it can.

    Args:
        investigation: "A" to "D".
        cell: the comparison.
        world: key of the investigation's `worlds`.

    Returns:
        a sentence without its full stop, of the first side that cannot be made.
    """
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
