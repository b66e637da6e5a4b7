"""Findings that come with the package: what has been run, so that nobody has to.

A finding belongs to the settings and the code that its runs had (`provenance`). One
that is not of today's is *stale*: it is shown as such and counts as not run.

Beside the findings stands what was measured of every run behind them, batch by batch. A
comparison that asks for more runs goes on from there, on any machine.
"""

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from bns.claims import provenance
from bns.claims.claim import Cell, Claim, settings_of
from bns.claims.provenance import Batch, Made
from bns.claims.verdict import Finding
from bns.errors import BnsError, FormatError
from bns.experiment.versions import REVISION
from bns.stats import Interval
from bns.storage.files import write_bytes

FILE = "published.json"
SCHEMA = 3
NEVER = "never"
FACTS = ("revision", "seed", "commit", "versions")
NO_SETTINGS = "made before findings kept the settings of their runs"

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Stale:
    """A finding that is not of today's settings and code.

    Attributes:
        text: of the comparison.
        runs: on each side.
        share: of pairs that a won.
        p: of it.
        why: where it differs.
    """

    text: str
    runs: tuple[int, ...]
    share: float
    p: float
    why: str


@dataclass(frozen=True)
class Library:
    """A file of findings.

    Attributes:
        rows: a finding each, by world, claim and text of the comparison.
        settings: digest of a side -> its settings.
        runs: digest of a side -> batches of it, as `line` gives them, run by the code
            of today's revision.
    """

    rows: Mapping[tuple[str, str, str], Row]
    settings: Mapping[str, provenance.Settings]
    runs: Mapping[str, Sequence[Row]] = field(default_factory=dict)

    def batches(self, digest: str, measures: Collection[str]) -> list[Batch]:
        """The batches of a side of which all of these measures are known."""
        lines = self.runs.get(digest, ())
        return [_batch(each) for each in lines if set(measures) <= set(each["values"])]


@cache
def library() -> Library:
    """The findings that come with the package."""
    path = files("bns.claims.data") / FILE
    return parse(path.read_text(encoding="utf-8"), FILE)


def parse(text: str, name: str) -> Library:
    """The findings in the text of a file.

    Raises:
        FormatError: not such a file, or of a newer version.
    """
    try:
        content = json.loads(text)
        if isinstance(content, list):  # schema 1 had rows alone
            content = {"schema": 1, "findings": content, "bases": {}, "sides": {}}
        if content["schema"] > SCHEMA:
            raise FormatError(
                f"{name} has schema {content['schema']}, this version reads up to "
                f"{SCHEMA}: install a newer bns."
            )
        rows = {(r["world"], r["claim"], r["cell"]): r for r in content["findings"]}
        bases = content["bases"]
        known = {
            digest: _whole(bases[base], differing)
            for digest, (base, differing) in content["sides"].items()
        }
        runs: dict[str, list[Row]] = {}
        for each in content.get("runs", ()):
            if _batch(each).facts["revision"] == REVISION:
                runs.setdefault(each["side"], []).append(each)
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(f"{name} holds no findings: {error}.") from error
    return Library(rows, known, runs)


def _batch(line: Row) -> Batch:
    """A batch from its line: null is no value, "never" is infinite."""
    said = {None: np.nan, NEVER: np.inf}
    values = {
        name: np.array([said.get(value, value) for value in found], float)
        for name, found in line["values"].items()
    }
    facts = {key: line[key] for key in FACTS}
    start, count = int(line["start"]), int(line["count"])
    if any(len(found) != count for found in values.values()):
        raise ValueError(f"a batch of {line['side']} has not {count} values")
    return Batch(start, count, facts, line["date"], line["seconds"], values.__getitem__)


def line(digest: str, batch: Batch, measures: Sequence[str]) -> dict[str, Any]:
    """A batch of runs as it is published.

    Args:
        digest: of the side's settings.
        batch: its runs.
        measures: names of what is published of each.
    """
    return {
        "side": digest,
        "start": batch.start,
        "count": batch.count,
        **{key: batch.facts[key] for key in FACTS},
        "date": batch.date,
        "seconds": round(batch.seconds, 1),
        "values": {
            name: [_told(value) for value in batch.values(name)] for name in measures
        },
    }


def _told(value: float) -> float | str | None:
    if np.isnan(value):
        return None
    return NEVER if value == np.inf else float(value)


def finding(
    claim: Claim, cell: Cell, *, world: str, among: Library | None = None
) -> Finding | Stale | None:
    """What was published on a comparison; None = nothing.

    Args:
        claim: whose comparison it is.
        cell: what is compared.
        world: where it ran.
        among: the findings; those of the package by default.
    """
    among = among or library()
    row = among.rows.get((world, claim.id, cell.text))
    if row is None:
        return None
    why = _why_stale(row, claim, cell, world, among)
    if why:
        share = float(row["share"][0])
        return Stale(cell.text, tuple(row["runs"]), share, float(row["p"]), why)
    made = {key: _tuples(row[key]) for key in Made.__dataclass_fields__}
    return Finding(
        cell=cell,
        runs=tuple(row["runs"]),
        p_look=row["p_look"],
        p=row["p"],
        p_equivalent=row["p_equivalent"],
        share=Interval(*row["share"]),
        stopped=row["stopped"],
        power=row["power"],
        published=True,
        made=Made(**made),
    )


def _why_stale(row: Row, claim: Claim, cell: Cell, world: str, among: Library) -> str:
    """Why a row is not of today's settings and code; empty where it is."""
    if "revision" not in row:
        return NO_SETTINGS
    if row["revision"] != REVISION:
        return f"of revision {row['revision']} of the code, today's is {REVISION}"
    for side, digest in zip(cell.sides, row["sides"], strict=True):
        try:
            now = settings_of(claim.investigation, side, world)
        except BnsError as error:
            return str(error)
        if provenance.of(now) != digest:
            then = among.settings.get(digest, {})
            return f"{side}: {provenance.difference(now, then)}"
    return ""


def row(claim: Claim, found: Finding, *, world: str) -> dict[str, Any]:
    """A finding as it is published, nothing rounded.

    Args:
        claim: that the comparison belongs to.
        found: its finding.
        world: key of the investigation's `worlds`.

    Raises:
        BnsError: it is not known from what it was made.
    """
    if found.made is None:
        raise BnsError(f"{claim.id}: {found.cell.text} has no provenance to publish.")
    return {
        "world": world,
        "claim": claim.id,
        "cell": found.cell.text,
        "runs": list(found.runs),
        "p_look": found.p_look,
        "p": found.p,
        "p_equivalent": found.p_equivalent,
        "share": list(found.share),
        "stopped": found.stopped,
        "power": found.power,
        **json.loads(json.dumps(asdict(found.made))),
    }


def text(
    rows: Sequence[Row],
    settings: Mapping[str, provenance.Settings],
    runs: Sequence[Row] = (),
) -> str:
    """The file of findings, a line each.

    Args:
        rows: the findings.
        settings: digest of a side -> its settings, of all sides in `rows` of which
            they are known.
        runs: batches, as `line` gives them.
    """
    used = sorted({d for r in rows if "revision" in r for d in r["sides"]})
    bases: dict[str, Mapping[str, Any]] = {}
    lines = []
    for digest in (d for d in used if d in settings):
        whole = settings[digest]
        kind = provenance.of({"keys": list(whole)})
        base = bases.setdefault(kind, whole)
        differing = {k: v for k, v in whole.items() if base[k] != v}
        lines.append(f'"{digest}": {json.dumps([kind, differing])}')
    parts = [
        f'"schema": {SCHEMA}',
        _block("bases", (f'"{k}": {json.dumps(v)}' for k, v in bases.items()), "{}"),
        _block("sides", lines, "{}"),
        _block("findings", (json.dumps(each) for each in rows), "[]"),
        _block("runs", (json.dumps(each) for each in runs), "[]"),
    ]
    return "{\n" + ",\n".join(parts) + "\n}\n"


def write(
    path: Path,
    rows: Sequence[Row],
    settings: Mapping[str, provenance.Settings],
    runs: Sequence[Row] = (),
) -> None:
    """Publish findings as `text` writes them.

    Args:
        path: of the file, replaced whole.
        rows: the findings.
        settings: digest of a side -> its settings, see `text`.
        runs: batches, as `line` gives them.

    Raises:
        StorageError: no space, or no permission.
    """
    write_bytes(path, text(rows, settings, runs).encode())


def _block(name: str, lines: Iterable[str], brackets: str) -> str:
    inside = ",\n".join(lines)
    opened, closed = brackets[0], brackets[1]
    return (
        f'"{name}": {opened}\n{inside}\n{closed}'
        if inside
        else (f'"{name}": {brackets}')
    )


def _whole(base: Mapping[str, Any], differing: Mapping[str, Any]) -> dict[str, Any]:
    return {**base, **differing}


def _tuples(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
