"""Findings that come with the package: what has been run, so that nobody has to.

A finding belongs to the settings that its runs had. Where those of a side have changed
since, what was published on it is as good as not there.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path

from bns.claims import verdict
from bns.claims.claim import Cell, Claim
from bns.claims.verdict import Finding
from bns.stats import Interval
from bns.storage.files import write_bytes

FILE = "published.json"

Row = Mapping[str, str | float | list]


@cache
def rows() -> Mapping[tuple[str, str, str], Row]:
    """All that is published, by world, claim and comparison."""
    text = (files("bns.claims.data") / FILE).read_text(encoding="utf-8")
    return {(r["world"], r["claim"], r["cell"]): r for r in json.loads(text)}


def finding(
    claim: Claim, cell: Cell, names: Sequence[str], *, world: str
) -> Finding | None:
    """What was published on a comparison; None = nothing, or of other settings.

    Args:
        claim: whose comparison it is.
        cell: what is compared.
        names: identities of its sides.
        world: where they ran.
    """
    row = rows().get((world, claim.id, cell.text))
    if row is None or row["sides"] != list(names):
        return None
    share = Interval(*row["share"])
    found = verdict.finding(cell, tuple(row["runs"]), row["p"], share)
    return replace(found, published=True)


def row(
    claim: Claim, found: Finding, names: Sequence[str], *, world: str
) -> dict[str, str | float | list]:
    """A finding as it is published; arguments as for `finding`."""
    return {
        "world": world,
        "claim": claim.id,
        "cell": found.cell.text,
        "sides": list(names),
        "runs": list(found.runs),
        "p": found.p,
        "share": list(found.share),
    }


def write(path: Path, findings: Sequence[Row]) -> None:
    """Publish findings, a line each.

    Raises:
        StorageError: no space, or no permission.
    """
    lines = ",\n".join(json.dumps(each) for each in findings)
    write_bytes(path, f"[\n{lines}\n]\n".encode())
