"""Claims of one investigation, run where they are missing, and judged."""

from collections.abc import Sequence

from bench import experiments
from bench.result import Result
from bench.versions import ROOT
from bns.claims import report, runner
from bns.claims.claim import claims

WORLD = "mujoco"


def judged(wanted: Sequence[str], *, runs: int, quick: bool) -> Result:
    """How many of some claims have a verdict; runs are kept, so a run goes on.

    Claims of which as many runs a side are published are not run again:
    `bns claims run ID --runs N` does that.

    Args:
        wanted: identifiers of claims.
        runs: a side, at least; the bar is judged from 30 on.
        quick: small and short runs, all of them made here.
    """
    from bns.campaign.engines import registry

    chosen = [claims()[name] for name in wanted]
    root = ROOT / "runs" / "claims"
    engine = registry.make("local", workers=experiments.WORKERS)
    least = 0 if quick else runs
    place = runner.directory(WORLD, quick=quick, root=root)

    def judge() -> list[report.Judged]:
        return report.judged(chosen, place, world=WORLD, quick=quick, own=False)

    rows = judge()
    due = [r.claim for r in rows if not r.complete or r.fewest < max(least, 1)]
    if due:
        runner.run(due, engine, world=WORLD, quick=quick, runs=least, root=root)
        rows = judge()
    found = [row for row in rows if row.findings]
    few = quick or runs < experiments.REPLICATES
    return Result(
        figure=len(found),
        unit=f"of {len(wanted)}",
        holds=None if few else len(found) == len(wanted),
        n=min((row.fewest for row in found), default=0),
        details={
            row.claim.id: {
                "says": row.claim.says,
                "verdict": row.verdict,
                "cells": [list(cell) for cell in report.cells(row)],
                "published": sum(finding.published for finding in row.findings),
            }
            for row in rows
        },
    )
