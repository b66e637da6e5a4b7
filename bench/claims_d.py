"""Claims of the hexapod (investigation D) that the dissertation rests on."""

from bench import experiments
from bench.result import Result
from bench.versions import ROOT
from bns.claims import report, runner
from bns.claims.claim import claims

DOC = "claims D1, D20, D22, D25, D27, D29 with a verdict (types 0 and 14)"
BAR = "6 of 6, printed whichever way"
WANTED = ("D1", "D20", "D22", "D25", "D27", "D29")
WORLD = "mujoco"


def run(quick: bool) -> Result:
    """Train what is missing, 30 runs a side, then judge; quick: small and short.

    Settings are the dissertation's (table 7.2) over the preset; runs are kept, so a
    run that is stopped goes on.
    """
    from bns.campaign.engines import registry

    chosen = [claims()[name] for name in WANTED]
    root = ROOT / "runs" / "claims"
    engine = registry.make("local", workers=experiments.WORKERS)
    runner.run(chosen, engine, world=WORLD, quick=quick, root=root)
    place = runner.directory(WORLD, quick=quick, root=root)
    rows = report.judged(chosen, place, world=WORLD, quick=quick)
    judged = [row for row in rows if row.findings]
    return Result(
        figure=len(judged),
        unit=f"of {len(WANTED)}",
        holds=None if quick else len(judged) == len(WANTED),
        n=min((min(f.runs) for row in judged for f in row.findings), default=0),
        details={
            row.claim.id: {
                "says": row.claim.says,
                "verdict": row.verdict,
                "cells": [list(cell) for cell in report.cells(row)],
            }
            for row in rows
        },
    )
