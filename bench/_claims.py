"""Claims of one investigation, trained where they are missing, and judged."""

from collections.abc import Sequence

from bench import experiments
from bench.result import Result
from bench.versions import ROOT
from bns.claims import report, runner
from bns.claims.claim import claims

WORLD = "mujoco"


def judged(wanted: Sequence[str], *, runs: int, quick: bool) -> Result:
    """How many of some claims have a verdict; runs are kept, so a run goes on.

    Args:
        wanted: identifiers of claims.
        runs: a side, at least; the bar is judged from 30 on.
        quick: small and short runs.
    """
    from bns.campaign.engines import registry

    chosen = [claims()[name] for name in wanted]
    root = ROOT / "runs" / "claims"
    engine = registry.make("local", workers=experiments.WORKERS)
    least = 0 if quick else runs
    runner.run(chosen, engine, world=WORLD, quick=quick, runs=least, root=root)
    place = runner.directory(WORLD, quick=quick, root=root)
    rows = report.judged(chosen, place, world=WORLD, quick=quick)
    found = [row for row in rows if row.findings]
    few = quick or runs < experiments.REPLICATES
    return Result(
        figure=len(found),
        unit=f"of {len(wanted)}",
        holds=None if few else len(found) == len(wanted),
        n=min((min(f.runs) for row in found for f in row.findings), default=0),
        details={
            row.claim.id: {
                "says": row.claim.says,
                "verdict": row.verdict,
                "cells": [list(cell) for cell in report.cells(row)],
            }
            for row in rows
        },
    )
