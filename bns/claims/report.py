"""Findings on claims, as rows and as the page docs/claims.md."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bns.campaign.results import records
from bns.campaign.store import CampaignStore
from bns.claims import published, sides, verdict
from bns.claims.claim import KINDS, Cell, Claim
from bns.claims.verdict import Finding
from bns.errors import BnsError
from bns.experiment.record import RunRecord

NOT_RUN, NOT_TESTED = "not run", "not tested"
VERDICTS = ("holds", "direction only", "null", "reversed", NOT_RUN, NOT_TESTED)


@dataclass(frozen=True)
class Judged:
    """A claim and what runs say of it.

    Attributes:
        claim: what the dissertation says.
        findings: of the cells that have runs.
        verdict: the least favourable of theirs, "not run" or "not tested".
        note: why some or all of it is missing.
    """

    claim: Claim
    findings: tuple[Finding, ...]
    verdict: str
    note: str = ""

    @property
    def complete(self) -> bool:
        """Whether every cell has a finding."""
        return len(self.findings) == len(self.claim.cells)

    @property
    def fewest(self) -> int:
        """Runs of the side that has fewest, of the cells with a finding; 0 = none."""
        return min((min(finding.runs) for finding in self.findings), default=0)

    @property
    def provisional(self) -> bool:
        """Whether cells are missing, or rest on fewer runs than the rule asks for."""
        return bool(self.findings) and (
            not self.complete or any(finding.provisional for finding in self.findings)
        )


def judged(
    claims: Sequence[Claim],
    directory: Path,
    *,
    world: str,
    quick: bool = False,
    own: bool = True,
) -> list[Judged]:
    """All claims, judged by the runs in a store; without a store none has runs.

    Args:
        claims: to be judged.
        directory: the store.
        world: where its runs are of.
        quick: whether they are the small and short ones.
        own: by these runs alone; else a comparison of which more runs are published
            than there are has the published finding (never a quick one).

    Raises:
        FormatError: the store is damaged or of a newer version.
    """
    found: dict[str, RunRecord] = {}
    if (directory / "campaign.json").exists():
        wanted = {
            name
            for claim in claims
            for cell in claim.cells
            for name in _names(claim, cell.sides, world, quick)
        }
        found = records(CampaignStore.open(directory), wanted)
    rows = [_judge(claim, found, world, quick, own or quick) for claim in claims]
    flat = [finding for row in rows for finding in row.findings]
    adjusted = iter(verdict.adjusted(flat))
    return [
        Judged(
            row.claim,
            tuple(next(adjusted) for _ in row.findings),
            row.verdict,
            row.note,
        )
        for row in rows
    ]


def _names(
    claim: Claim, pieces: tuple[str, ...], world: str, quick: bool
) -> tuple[str, ...]:
    """Identities of sides; none where one of them cannot run."""
    try:
        return tuple(
            sides.member(claim.investigation, side, world=world, quick=quick).identity
            for side in pieces
        )
    except BnsError:
        return ()


def _judge(
    claim: Claim, found: dict[str, RunRecord], world: str, quick: bool, own: bool
) -> Judged:
    if claim.untested:
        return Judged(claim, (), NOT_TESTED, claim.untested)
    findings, missing = [], []
    for cell in claim.cells:
        names = _names(claim, cell.sides, world, quick)
        finding = _finding(cell, [found[name] for name in names if name in found])
        kept = None if own else published.finding(claim, cell, names, world=world)
        if finding is None or (kept and min(kept.runs) > min(finding.runs)):
            finding = kept
        if finding:
            findings.append(finding)
        elif not names:
            missing.append(sides.missing(claim.investigation, cell, world=world))
        elif not all(name in found for name in names):
            missing.append("no runs yet")
    if not findings:
        return Judged(claim, (), NOT_RUN, missing[0] if missing else "no such figures")
    note = f"{len(missing)} of {len(claim.cells)} cells not run" if missing else ""
    said = verdict.of_claim(claim.kind, findings)
    return Judged(claim, tuple(findings), said, note)


def _finding(cell: Cell, have: Sequence[RunRecord]) -> Finding | None:
    """What runs say of a cell; None where a side has none."""
    if not have or len(have) < len(cell.sides):
        return None
    return verdict.judge(cell, have[0], have[1] if cell.b else None)


def publishable(worlds: Mapping[str, Sequence[Judged]]) -> list[published.Row]:
    """All findings as they are published.

    Args:
        worlds: name of the world -> all claims, judged.
    """
    return [
        published.row(
            row.claim,
            finding,
            _names(row.claim, finding.cell.sides, world, False),
            world=world,
        )
        for world, rows in worlds.items()
        for row in rows
        for finding in row.findings
    ]


def counts(rows: Sequence[Judged]) -> dict[str, int]:
    """How many claims have which verdict."""
    found = Counter(row.verdict for row in rows)
    return {name: found[name] for name in VERDICTS}


HEAD = ("comparison", "p (diss.)", "runs", "p", "p (Holm)", "share", "verdict")


def cells(row: Judged) -> list[tuple[str, ...]]:
    """A row of texts for each finding of a claim."""
    return [
        (
            finding.cell.text,
            finding.cell.p,
            " v ".join(map(str, finding.runs)) + ("*" if finding.provisional else ""),
            number(finding.p),
            number(finding.p_holm),
            f"{finding.share.value:.2f} ({finding.share.low:.2f} to "
            f"{finding.share.high:.2f})",
            finding.verdict,
        )
        for finding in row.findings
    ]


def number(p: float) -> str:
    """A p value, to five decimals as in the dissertation."""
    return f"{p:.5f}"


def kind(claim: Claim) -> str:
    """The kind of a claim in words."""
    return KINDS[claim.kind]
