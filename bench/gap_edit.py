"""Error of the edited twin against that of the true one."""

from statistics import median

from bench.gap_runner import ensure
from bench.result import Result, bench


@bench("error of the edited twin against that of the true one", bar="<= 1.5 x")
def gap_edit(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""
    from bns.gap.bench import scoring

    rows = ensure(quick)
    edits = [r["said"]["edit"] for r in scoring.of(rows, "pair") if "edit" in r["said"]]
    ratios = sorted(edit["ours"] / edit["oracle"] for edit in edits)
    figure = median(ratios) if ratios else float("nan")
    return Result(
        figure=figure,
        unit="x",
        holds=figure <= 1.5,
        n=len(ratios),
        details={"ratios": [round(ratio, 3) for ratio in ratios]},
    )
