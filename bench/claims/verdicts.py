"""Claims as they stand in each world: those settled, and findings that are stale."""

from bench.result import Result, bench
from bench.versions import ROOT
from bns.claims import claim, provenance, published, report, runner
from bns.claims.report import Judged

LEAST_MUJOCO, LEAST_STATIC = 150, 120


@bench(
    "claims with all comparisons at the runs that their design asks for, in MuJoCo",
    bar=">= 150 of 157",
)
def claims(quick: bool) -> Result:
    """Judge what has been run: nothing is trained here; `bns claims run --all` does."""
    del quick
    return settled("mujoco", bar=LEAST_MUJOCO)


@bench(
    "claims with all comparisons at the runs that their design asks for, static-SNN",
    bar=">= 120 of 157",
)
def claims_static(quick: bool) -> Result:
    """Judge what has been run: `bns claims run --all --world static-snn` runs it."""
    del quick
    return settled("static-snn", bar=LEAST_STATIC)


@bench("findings shown as current that do not match today's settings or code", bar="0")
def claims_stale(quick: bool) -> Result:
    """Every side of every finding shown, its settings resolved anew; and those stale.

    The settings kept with a finding have to give its digest, too.
    """
    del quick
    wrong, shown, stale = [], 0, {}
    for world in ("mujoco", "static-snn"):
        rows = judged(world)
        shown += sum(len(row.findings) for row in rows)
        wrong += [text for row in rows for text in _wrong(row, world)]
        stale[world] = sum(len(row.stale) for row in rows)
    known = published.library().settings
    broken = [digest for digest, kept in known.items() if provenance.of(kept) != digest]
    return Result(
        figure=len(wrong) + len(broken),
        unit="findings",
        holds=not wrong and not broken,
        n=shown,
        details={
            "shown as current": shown,
            "wrong": wrong,
            "settings that do not give their digest": broken,
            "shown as stale": stale,
            "claims": len(claim.claims()),
        },
    )


def _wrong(row: Judged, world: str) -> list[str]:
    """Findings of a claim that today's settings or code would not give."""
    found = []
    for each in row.findings:
        letter = row.claim.investigation
        now = []
        for side in each.cell.sides:
            config = claim.member(letter, side, world=world).config
            ignored = claim.content(letter)["ignored"]
            now.append(provenance.of(provenance.resolved(config, ignored)))
        if each.made is None or not provenance.current(each.made, tuple(now)):
            found.append(f"{world} {row.claim.id}: {each.cell.text}")
    return found


def judged(world: str) -> list[Judged]:
    """All claims in a world; nothing is trained."""
    place = runner.directory(world, quick=False, root=ROOT / "runs" / "claims")
    return report.judged(list(claim.claims().values()), place, world=world, own=False)


def settled(world: str, *, bar: int) -> Result:
    """Claims whose comparisons all have the runs that the design asks for.

    Commit and seconds are those of the findings, not of this reading.

    Args:
        world: where.
        bar: how many there are to be.
    """
    rows = judged(world)
    made = [each.made for row in rows for each in row.findings if each.made]
    done = [row for row in rows if row.settled]
    details: dict[str, object] = {"all": report.counts(rows)}
    for letter in claim.INVESTIGATIONS:
        part = [row for row in rows if row.claim.investigation == letter]
        details[letter] = report.counts(part)
    details["not settled"] = {
        row.claim.id: row.note or "more runs" for row in rows if not row.settled
    }
    details["verdicts"] = {row.claim.id: row.verdict for row in done}
    return Result(
        figure=len(done),
        unit=f"of {len(rows)}",
        holds=len(done) >= bar,
        n=min((row.fewest for row in done), default=0),
        details=details,
        commits=tuple(sorted({c for each in made for c in each.commits})),
        seconds=sum(each.seconds for each in made) if made else None,
    )
