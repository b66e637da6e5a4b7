"""Claims and their cells, read from the data files, and the sides that they compare.

A side of a comparison is a configuration, as far as what it needs exists.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any

from bns import presets
from bns.campaign.file import Member
from bns.campaign.identity import flatten, with_settings
from bns.claims import provenance
from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import RunConfig
from bns.learners.bns.config import EvolutionConfig
from bns.worlds.damage import Damage

INVESTIGATIONS = ("A", "B", "C", "D")
KINDS = {
    "S": "a difference with a p value",
    "N": "no difference",
    "Q": "read from a figure",
    "R": "one run on the real robot",
    "I": "an interpretation",
}


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One comparison.

    Attributes:
        a: pieces of one side, as text.
        b: pieces of the other; empty where a number stands on the other side.
        says: ">", "<", "=", "?" as in `bns.claims`.
        p: as the dissertation prints it: a number, a bound, "n.s.", or "-".
        measure: what is measured of a, see `bns.claims.measures`.
        measure_b: what is measured of b.
        at_most: a's value is claimed to be no larger.
        at_least: a's value is claimed to be no smaller.
        variant: another reading, or other settings where the dissertation is silent;
            it stands beside the claim and counts for nothing in its verdict. Empty =
            the claim itself.
    """

    a: str
    b: str = ""
    says: str = ">"
    p: str = "-"
    measure: str = "observation"
    measure_b: str = ""
    at_most: float | None = None
    at_least: float | None = None
    variant: str = ""

    @property
    def sides(self) -> tuple[str, ...]:
        """The sides that have to be run."""
        return (self.a, self.b) if self.b else (self.a,)

    @property
    def text(self) -> str:
        """The comparison in words; those of a claim differ."""
        return f"{self._text} [{self.variant}]" if self.variant else self._text

    @property
    def _text(self) -> str:
        if self.at_most is not None:
            return f"{self.a}: {self.measure} <= {self.at_most:g}"
        if self.at_least is not None:
            return f"{self.a}: {self.measure} >= {self.at_least:g}"
        if self.measure_b:
            mine, other = f" ({self.measure})", f" ({self.measure_b})"
            return f"{self.a}{mine} {self.says} {self.b}{other}"
        what = "" if self.measure == "observation" else f" ({self.measure})"
        return f"{self.a} {self.says} {self.b}{what}"


@dataclass(frozen=True, kw_only=True)
class Claim:
    """What the dissertation says in one place.

    Attributes:
        id: A1 to D35.
        where: section, table, figure.
        says: the claim in one sentence.
        kind: key of `KINDS`.
        cells: what is compared; empty where it is not tested.
        reading: how it is measured, where the dissertation has no number.
        untested: why it is not tested; empty where it is.
    """

    id: str
    where: str
    says: str
    kind: str
    cells: tuple[Cell, ...] = ()
    reading: str = ""
    untested: str = ""

    @property
    def investigation(self) -> str:
        """A, B, C or D."""
        return self.id[0]


@cache
def content(investigation: str) -> Mapping[str, Any]:
    """The data file of an investigation."""
    path = files("bns.claims.data") / f"{investigation.lower()}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


@cache
def claims() -> Mapping[str, Claim]:
    """All claims by id, in the order of the dissertation."""
    found = {}
    for investigation in INVESTIGATIONS:
        data = content(investigation)
        for name, entry in data["claims"].items():
            cells = [Cell(**cell) for cell in entry.get("cells", ())]
            for other in data.get("variants", ()):
                if name in other["claims"]:
                    cells += _beside(cells, other["says"], other["piece"])
            found[name] = Claim(id=name, **{**entry, "cells": tuple(cells)})
    return found


def _beside(cells: Iterable[Cell], says: str, piece: str) -> list[Cell]:
    """The cells of a claim with another piece on both sides."""
    return [
        replace(
            cell,
            a=f"{cell.a} {piece}",
            b=f"{cell.b} {piece}" if cell.b else "",
            variant=says,
        )
        for cell in cells
        if not cell.variant
    ]


def find(name: str) -> Claim:
    """The claim called `name`, in capitals or not.

    Raises:
        BnsError: there is none.
    """
    known = claims()
    if name.upper() not in known:
        last = {claim.investigation: claim.id for claim in known.values()}
        ranges = ", ".join(f"{letter}1 to {name}" for letter, name in last.items())
        raise BnsError(
            f"Unknown claim {name!r}. Available: {ranges}; "
            "a letter alone means all claims of that investigation."
        )
    return known[name.upper()]


def chosen(names: Iterable[str]) -> list[Claim]:
    """The claims of some names, each once; of none, all.

    Args:
        names: of claims or of investigations, as in "A15" or "A", in capitals or not.

    Raises:
        BnsError: there is no such claim.
    """
    known = claims()
    found: dict[str, Claim] = {}
    for name in names:
        whole = [c for c in known.values() if c.investigation == name.upper()]
        found |= {claim.id: claim for claim in whole or [find(name)]}
    return list((found or known).values())


QUICK_TRIALS, QUICK_DIVISOR = 12, 5


def member_of(
    investigation: str, side: str, *, world: str, quick: bool = False
) -> Member:
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
        BnsError: as `member_of`.
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
        BnsError: as `member_of`.
    """
    return provenance.of(settings_of(investigation, side, world))


def lacking(investigation: str, cell: Cell, *, world: str) -> str:
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
            member_of(investigation, side, world=world)
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
