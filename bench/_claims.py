"""Claims as they stand in a world: by runs here, and by published findings."""

from bench.result import Result
from bench.versions import ROOT
from bns.claims import report, runner
from bns.claims.claim import INVESTIGATIONS, claims
from bns.claims.report import Judged


def judged(world: str) -> list[Judged]:
    """All claims in a world; nothing is trained."""
    place = runner.directory(world, quick=False, root=ROOT / "runs" / "claims")
    return report.judged(list(claims().values()), place, world=world, own=False)


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
    for letter in INVESTIGATIONS:
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
