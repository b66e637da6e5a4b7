"""Wall time of one wheeled case in a fresh process."""

import time

from bench.gap_runner import ensure
from bench.result import Result

DOC = "wall time of one wheeled case in a fresh process"
BAR = "<= 30 s"


def run(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""

    rows = ensure(quick)
    times = sorted(row["seconds"] for row in rows)
    cold = _cold()
    return Result(
        figure=round(cold, 2),
        unit="s",
        holds=cold <= 30,
        n=1,
        details={
            "median of the cases": times[len(times) // 2] if times else None,
            "longest": times[-1] if times else None,
        },
    )


def _cold() -> float:
    from bench.gap_effects import other_solver
    from bns.gap import cases
    from bns.gap.diagnose import diagnose
    from bns.gap.reduced import reduced
    from bns.gap.wheeled import WheeledModel

    case = cases.build(
        3, "single", WheeledModel(), extra=other_solver(), wanted="wheel_gain[left]"
    )
    reduced.cache_clear()
    begin = time.perf_counter()
    diagnose(case.trials, WheeledModel())
    return time.perf_counter() - begin
