"""Claims of investigation A that have a verdict, from runs here and published ones."""

from bench import experiments
from bench.result import Result
from bench.versions import ROOT
from bns.claims import report, runner
from bns.claims.claim import claims

DOC = "claims of investigation A with verdict, runs, p, A12 and interval"
BAR = "28 of 28"
WORLDS = ("mujoco", "static-snn")


def run(quick: bool) -> Result:
    """Judge what has been run: nothing is trained here.

    Runs of the other benches are taken first; where more are published of the same
    settings, those count. `bns claims run --all` runs the rest.
    """
    del quick
    chosen = list(claims().values())
    root = ROOT / "runs" / "claims"
    if experiments.RUNS.exists():
        runner.take(chosen, [experiments.RUNS], root=root)
    details: dict[str, object] = {}
    for world in WORLDS:
        place = runner.directory(world, quick=False, root=root)
        rows = report.judged(chosen, place, world=world, own=False)
        details[world] = report.counts(rows)
        mine = [row for row in rows if row.claim.investigation == "A"]
        details[f"{world}: verdicts of A"] = {row.claim.id: row.verdict for row in mine}
        if world == WORLDS[0]:
            judged = [row for row in mine if row.findings]
            partly = [row.claim.id for row in judged if row.note]
            few = [row.claim.id for row in judged if row.provisional]
    details["A, with comparisons not run"] = partly
    details["A, provisional"] = few
    runs = min((row.fewest for row in judged), default=0)
    return Result(
        figure=len(judged),
        unit=f"of {len(mine)}",
        holds=len(judged) == len(mine) and not partly,
        n=runs,
        details=details,
    )
