"""Findings on claims, as rows and as the page docs/claims.md."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from bns.campaign.file import Member
from bns.claims import provenance, published, verdict
from bns.claims.claim import (
    KINDS,
    Cell,
    Claim,
    claims,
    content,
    digest_of,
    lacking,
    member_of,
    settings_of,
)
from bns.claims.provenance import Held
from bns.claims.published import Library, Stale
from bns.claims.verdict import Finding
from bns.errors import BnsError
from bns.progress import Each, uncounted
from bns.stats.designs import Design, up_to

NOT_RUN, NOT_TESTED, STALE = "not run", "not tested", "stale"
VERDICTS = (
    "holds", "direction only", "null", "reversed", STALE, NOT_RUN, NOT_TESTED
)  # fmt: skip


@dataclass(frozen=True)
class Judged:
    """A claim and what runs say of it.

    Attributes:
        claim: what the dissertation says.
        findings: of the cells that have runs of today's settings.
        stale: findings of other settings or other code, of cells without a finding.
        verdict: one of `VERDICTS`.
        note: why some or all of it is missing.
    """

    claim: Claim
    findings: tuple[Finding, ...]
    stale: tuple[Stale, ...]
    verdict: str
    note: str = ""

    @property
    def own(self) -> tuple[Finding, ...]:
        """The findings that are no variants."""
        return tuple(each for each in self.findings if not each.cell.variant)

    @property
    def complete(self) -> bool:
        """Whether every cell that is no variant has a finding."""
        return len(self.own) == sum(not cell.variant for cell in self.claim.cells)

    @property
    def settled(self) -> bool:
        """Whether all of them have the runs that the design asks for."""
        return bool(self.own) and self.complete and not self.provisional

    @property
    def fewest(self) -> int:
        """Runs of the side that has fewest, of the cells with a finding; 0 = none."""
        return min((min(finding.runs) for finding in self.own), default=0)

    @property
    def provisional(self) -> bool:
        """Whether cells are missing, or the design asks for more runs of some."""
        return bool(self.own) and (
            not self.complete or any(finding.provisional for finding in self.own)
        )


def judged(
    wanted: Sequence[Claim],
    directory: Path,
    *,
    world: str,
    quick: bool = False,
    own: bool = True,
    runs: int = 0,
    among: Library | None = None,
    each: Each = uncounted,
) -> list[Judged]:
    """Claims, judged by the runs in a store; without a store none has runs.

    p values are adjusted over the whole investigation, whichever of its claims are
    asked for.

    Args:
        wanted: claims to be judged.
        directory: the store.
        world: where its runs are of.
        quick: whether they are the small and short ones.
        own: by these runs alone; else a comparison of which more runs are published
            than there are has the published finding (never a quick one).
        runs: the last look at most, instead of that of the design; 0 = the design's.
        among: published findings; by default those of the package.
        each: goes through the claims, and may count them.

    Raises:
        FormatError: the store is damaged or of a newer version.
    """
    letters = {claim.investigation for claim in wanted}
    family = [c for c in claims().values() if c.investigation in letters]
    members = sides(each(family), world, quick=quick)
    have = {}
    if (directory / "campaign.json").exists():
        have = held(members.values(), directory, own=own or quick, among=among)
    rows: dict[str, Judged] = {}
    judging = each if have else uncounted  # without runs it takes no time
    for letter in sorted(letters):
        part = [claim for claim in family if claim.investigation == letter]
        judge = _Judge(have, world, quick, own or quick, runs, among)
        found = _adjusted([judge(claim) for claim in judging(part)])
        rows |= {row.claim.id: row for row in found}
    return [rows[claim.id] for claim in wanted]


def _adjusted(rows: Sequence[Judged]) -> list[Judged]:
    """With Holm's p over all of them, and the verdicts that follow."""
    flat = iter(verdict.adjusted([each for row in rows for each in row.findings]))
    done = []
    for row in rows:
        found = tuple(next(flat) for _ in row.findings)
        said = row.verdict
        if any(not each.cell.variant for each in found):
            said = verdict.of_claim(row.claim.kind, found)
        done.append(replace(row, findings=found, verdict=said))
    return done


def identities(members: Iterable[Member]) -> dict[str, tuple[str, Sequence[str]]]:
    """Identity of sides -> digest of their settings, sections that are no part of it.

    Args:
        members: as `bns.claims.claim.member_of` gives them.
    """
    found: dict[str, tuple[str, Sequence[str]]] = {}
    for member in members:
        ignored = tuple(content(member.label[0])["ignored"])
        settings = provenance.resolved(member.config, ignored)
        found[member.identity] = (provenance.of(settings), ignored)
    return found


def held(
    members: Iterable[Member],
    directory: Path,
    *,
    own: bool = False,
    among: Library | None = None,
) -> dict[str, Held]:
    """The runs there are of sides: in a store, and those that are published.

    Args:
        members: as `bns.claims.claim.member_of` gives them.
        directory: the store; one that is not there holds none.
        own: those in the store alone.
        among: what is published; by default that of the package.

    Returns:
        identity -> `Held`.

    Raises:
        FormatError: the store is damaged or of a newer version.
    """
    wanted = identities(members)
    if own:
        return provenance.read(directory, wanted)
    among = among or published.library()
    kept = {
        digest: among.batches(digest, asked()[name])
        for name, (digest, _) in wanted.items()
    }
    return provenance.read(directory, wanted, kept)


@cache
def asked() -> Mapping[str, tuple[str, ...]]:
    """Identity of a side -> what any comparison measures of its runs, sorted."""
    found: dict[str, set[str]] = {}
    for claim in claims().values():
        for cell in claim.cells:
            measures = cell.measure, cell.measure_b or cell.measure
            for world in content(claim.investigation)["worlds"]:
                sides = _members(claim, cell, world, quick=False)
                for member, name in zip(sides, measures, strict=False):
                    found.setdefault(member.identity, set()).add(name)
    return {identity: tuple(sorted(names)) for identity, names in found.items()}


def sides(
    wanted: Iterable[Claim], world: str, *, quick: bool = False
) -> dict[str, Member]:
    """Identity -> side, of all comparisons of claims that can run in a world.

    Args:
        wanted: the claims.
        world: where they run.
        quick: small and short versions.
    """
    return {
        member.identity: member
        for claim in wanted
        for cell in claim.cells
        for member in _members(claim, cell, world, quick)
    }


def _members(claim: Claim, cell: Cell, world: str, quick: bool) -> tuple[Member, ...]:
    """The sides of a comparison; none where one of them cannot run."""
    letter = claim.investigation
    try:
        return tuple(
            member_of(letter, side, world=world, quick=quick) for side in cell.sides
        )
    except BnsError:
        return ()


@dataclass(frozen=True)
class _Judge:
    """Judges claims one by one; p values are not adjusted yet."""

    have: Mapping[str, Held]
    world: str
    quick: bool
    own: bool
    runs: int
    among: Library | None

    def __call__(self, claim: Claim) -> Judged:
        if claim.untested:
            return Judged(claim, (), (), NOT_TESTED, claim.untested)
        findings, stale, missing = [], [], []
        for cell in claim.cells:
            found = self.of(claim, cell)
            if isinstance(found, Finding):
                findings.append(found)
            elif isinstance(found, Stale):
                stale.append(found)
            if not isinstance(found, Finding) and not cell.variant:
                why = lacking(claim.investigation, cell, world=self.world)
                missing.append(why or "no runs yet")
        own = sum(not cell.variant for cell in claim.cells)
        if len(missing) == own:
            said = STALE if stale else NOT_RUN
            why = stale[0].why if stale else missing[0]
            return Judged(claim, tuple(findings), tuple(stale), said, why)
        note = f"{len(missing)} of {own} cells not run" if missing else ""
        return Judged(claim, tuple(findings), tuple(stale), "", note)

    def of(self, claim: Claim, cell: Cell) -> Finding | Stale | None:
        """What is known of a cell."""
        mine = self._mine(claim, cell)
        if self.own:
            return mine
        kept = published.finding(claim, cell, world=self.world, among=self.among)
        if not isinstance(kept, Finding):
            return mine or kept
        more = mine is not None and (
            mine.stopped or (min(mine.runs) >= min(kept.runs) and not kept.stopped)
        )
        return mine if more else kept

    def _mine(self, claim: Claim, cell: Cell) -> Finding | None:
        if not self.have:
            return None
        members = _members(claim, cell, self.world, self.quick)
        have = [self.have[m.identity] for m in members if m.identity in self.have]
        if not have or len(have) < len(cell.sides):
            return None
        found = verdict.judge(
            cell,
            have[0].values,
            have[1].values if cell.b else None,
            looks=looks(cell, self.runs),
        )
        if found is None:
            return None
        return replace(found, made=provenance.made(have, min(found.runs)))


def looks(cell: Cell, runs: int = 0) -> Design:
    """The looks at a comparison, the last one at `runs` at most; 0 = as designed."""
    design = verdict.design(cell)
    if not runs or runs >= design.looks[-1]:
        return design
    return up_to(runs)


def publishable(worlds: Mapping[str, Sequence[Judged]]) -> list[published.Row]:
    """All findings as they are published, and the stale ones that nothing replaces.

    Args:
        worlds: name of the world -> claims, judged.
    """
    before = published.library().rows
    rows: list[published.Row] = []
    for world, judged_ in worlds.items():
        for row in judged_:
            rows += [published.row(row.claim, f, world=world) for f in row.findings]
            rows += [before[world, row.claim.id, s.text] for s in row.stale]
    return rows


def runs(stores: Mapping[str, Path]) -> list[published.Row]:
    """The runs of all sides as they are published, those published before included.

    Args:
        stores: name of the world -> its store.

    Raises:
        FormatError: a store is damaged or of a newer version.
    """
    found: dict[tuple[str, int], published.Row] = {}
    for world, directory in stores.items():
        members = sides(claims().values(), world)
        for name, each in held(members.values(), directory).items():
            for batch in each.batches:
                line = published.line(each.digest, batch, asked()[name])
                found[each.digest, batch.start] = line
    return [found[key] for key in sorted(found)]


def settings(worlds: Mapping[str, Sequence[Judged]]) -> dict[str, Mapping]:
    """Digest -> settings of all sides in `publishable`."""
    found = dict(published.library().settings)
    for world, rows in worlds.items():
        for row in rows:
            for each in row.findings:
                for side in each.cell.sides:
                    letter = row.claim.investigation
                    digest = digest_of(letter, side, world)
                    found[digest] = settings_of(letter, side, world)
    return found


def counts(rows: Sequence[Judged]) -> dict[str, int]:
    """How many claims have which verdict."""
    found = Counter(row.verdict for row in rows)
    return {name: found[name] for name in VERDICTS}


HEAD = ("comparison", "p (diss.)", "runs", "p", "p (Holm)", "share", "verdict")


def cells(row: Judged) -> list[tuple[str, ...]]:
    """A row of texts for each finding of a claim, then for each stale one."""
    current: list[tuple[str, ...]] = [
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
    return current + [
        (
            stale.text,
            "",
            " v ".join(map(str, stale.runs)),
            number(stale.p),
            "",
            f"{stale.share:.2f}",
            f"{STALE}: {stale.why}",
        )
        for stale in row.stale
    ]


def number(p: float) -> str:
    """A p value, to five decimals as in the dissertation."""
    return f"{p:.5f}"


def kind(claim: Claim) -> str:
    """The kind of a claim in words."""
    return KINDS[claim.kind]
