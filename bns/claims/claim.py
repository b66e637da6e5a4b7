"""Claims and their cells, read from the data files."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any

from bns.errors import BnsError

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
