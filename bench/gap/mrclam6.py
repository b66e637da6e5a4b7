"""What five real iRobot Creates do otherwise than they are told, from their logs."""

from typing import Any

from bench.gap.real_data import needed
from bench.result import Result, bench

LATE = ("command_lag[all]", "command_delay[all]")
"""which of them it is, smooth commands do not tell"""
GAIN = "command_gain[forward_speed]"


@bench(
    "MRCLAM 6: robots whose lag and forward gain are named with their shares",
    bar="5 of 5",
)
def gap_mrclam6(quick: bool) -> Result:
    """One diagnosis a robot, about 10 s each; quick: the first robot alone."""
    from bns.gap.importers import mrclam6

    home = needed("mrclam6")
    robots = mrclam6.robots(home)[: 1 if quick else None]
    rows = {robot: _one(home, robot) for robot in robots}
    named = [row["named"] for row in rows.values()]
    return Result(
        figure=sum(named) / len(named),
        unit="share",
        holds=all(named),
        n=len(named),
        details={f"robot {robot}": row for robot, row in rows.items()},
    )


def _one(home: Any, robot: int) -> dict[str, Any]:
    from bns.gap.diagnose import diagnose
    from bns.gap.models.unicycle import UnicycleModel
    from bns.gap.recordings import load_recordings

    model = UnicycleModel()
    trials = load_recordings.trials([str(home)], model, importer="mrclam6")
    trials = [t for t in trials if t.conditions["robot_number"] == robot]
    found = diagnose(trials, model, full=False)
    parts = {part["name"]: part for part in found.decomposition["parts"]}
    explained = found.verdict.kind not in ("no gap", "none of the library")
    late = [name for name in LATE if name in parts]
    return {
        "named": bool(explained and late and GAIN in parts),
        "verdict": found.verdict.kind,
        "trials": len(trials),
        "parts": {
            name: {key: part[key] for key in ("values", "low", "high", "last", "alone")}
            for name, part in parts.items()
        },
        "closed": found.closed["closed"],
        "left": found.decomposition["left"],
        "seconds": found.seconds,
    }
