"""Findings that are shown as current and are not of today's settings and code."""

from bench._claims import judged
from bench.result import Result, bench
from bns.claims import provenance, published, sides
from bns.claims.claim import claims
from bns.claims.report import Judged


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
            "claims": len(claims()),
        },
    )


def _wrong(row: Judged, world: str) -> list[str]:
    """Findings of a claim that today's settings or code would not give."""
    found = []
    for each in row.findings:
        letter = row.claim.investigation
        now = []
        for side in each.cell.sides:
            config = sides.member(letter, side, world=world).config
            ignored = sides.content(letter)["ignored"]
            now.append(provenance.of(provenance.resolved(config, ignored)))
        if each.made is None or not provenance.current(each.made, tuple(now)):
            found.append(f"{world} {row.claim.id}: {each.cell.text}")
    return found
