"""Claims of one investigation, trained where they are missing, and judged."""

from collections.abc import Sequence

from bench import experiments
from bench.result import Result
from bench.versions import ROOT
from bns.claims import report, runner
from bns.claims.claim import claims

WORLD = "mujoco"
RUNS = 10  # a side; with fewer than the rule's 30 or 100 a verdict is provisional


def judged(wanted: Sequence[str], *, quick: bool) -> Result:
    """How many of some claims have a verdict, by `RUNS` a side; they are kept.

    The bar is judged from 30 a side on.

    Args:
        wanted: identifiers of claims.
        quick: small and short runs.
    """
    from bns.campaign.engines import registry

    chosen = [claims()[name] for name in wanted]
    root = ROOT / "runs" / "claims"
    engine = registry.make("local", workers=experiments.WORKERS)
    runs = 0 if quick else RUNS
    runner.run(chosen, engine, world=WORLD, quick=quick, runs=runs, root=root)
    place = runner.directory(WORLD, quick=quick, root=root)
    rows = report.judged(chosen, place, world=WORLD, quick=quick)
    found = [row for row in rows if row.findings]
    few = quick or RUNS < experiments.REPLICATES
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
