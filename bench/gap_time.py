"""Wall time of one wheeled case in a fresh process."""

import time

from bench.gap_runner import ensure
from bench.result import Result

DOC = "wall time of one wheeled case in a fresh process"
BAR = "<= 30 s"


def run(quick: bool) -> Result:
    """Score the cases; the missing ones are made and diagnosed first."""

    rows = ensure(quick)
    wall = sorted(row["seconds"] for row in rows)
    busy = sorted(row["cpu"] for row in rows)
    cold, cold_busy = _cold()
    return Result(
        figure=round(cold, 2),
        unit="s",
        holds=cold <= 30,
        n=1,
        details={
            "its processor time": round(cold_busy, 2),
            "median wall time of the cases, scoring included": _median(wall),
            "median processor time of the cases": _median(busy),
            "longest processor time": busy[-1] if busy else None,
        },
    )


def _median(ordered: list[float]) -> float | None:
    return round(ordered[len(ordered) // 2], 2) if ordered else None


def _cold() -> tuple[float, float]:
    from bench.gap_effects import other_solver
    from bns.gap.bench import cases
    from bns.gap.bench.wheeled_cases import WheeledStand
    from bns.gap.diagnose import diagnose
    from bns.gap.models.wheeled import WheeledModel

    case = cases.build(
        3,
        "single",
        WheeledStand(WheeledModel(), other_solver()),
        wanted="wheel_gain[left]",
    )
    begin, busy = time.perf_counter(), time.process_time()
    diagnose(case.trials, WheeledModel(threads=1))
    return time.perf_counter() - begin, time.process_time() - busy
