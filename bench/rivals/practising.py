"""Whether a learner that practises and is told by the diagnosis recovers sooner."""

from typing import Any

import numpy as np

from bench.learning import experiments
from bench.result import Result, bench
from bench.rivals import batches

ONSET, AFTER = 12, 20
RUNS = 6
WHEELS = {f"{side} wheel 20 % slower": side for side in ("left", "right")}
WAYS: dict[str, dict[str, Any]] = {
    "practises, diagnoses": {"learner": "practising"},
    "practises": {"learner": "practising", "settings.diagnose": False},
    "no model, forgets by evidence": {"learner": "bns", "watch.forget": True},
}
"""the last is the learner bns as it is, that nobody tells of the damage either"""


@bench(
    "trials until a robot that practises and is diagnosed solves navigation again",
    bar="median at most half of that without the diagnosis, and without a model",
)
def practising_recovers(quick: bool) -> Result:
    """`RUNS` runs a way and wheel, none told of the damage; quick: one, left wheel."""
    details: dict[str, Any] = {way: {} for way in WAYS}
    all_of: dict[str, list[np.ndarray]] = {way: [] for way in WAYS}
    for name, side in list(WHEELS.items())[: 1 if quick else None]:
        for way, told in WAYS.items():
            columns = _columns(side, told, 1 if quick else RUNS)
            again = experiments.first(columns["solved"][:, ONSET:] > 0)
            all_of[way].append(again)
            details[way][name] = {
                "solved before, share": float(columns["solved"][:, :ONSET].mean()),
                "until solved again": experiments.waits(again),
                "solved after": float(columns["solved"][:, ONSET:].mean()),
            }
            if "mended" in columns:
                mended = columns["mended"][:, ONSET:] > 0
                details[way][name]["mended after"] = experiments.waits(
                    experiments.first(mended)
                )
    medians = {way: np.median(np.concatenate(rows)) for way, rows in all_of.items()}
    own, *others = medians.values()
    return Result(
        figure=experiments.plain(own),
        unit="trials",
        holds=None if quick else bool(all(own <= other / 2 for other in others)),
        n=sum(map(len, all_of["practises, diagnoses"])),
        details={
            "medians": {way: experiments.plain(v) for way, v in medians.items()},
            **details,
        },
    )


def _columns(side: str, told: dict[str, Any], runs: int) -> dict[str, np.ndarray]:
    damage = [f"wheel_gain:wheel={side},factor=0.8@{ONSET}"]
    model = {} if told["learner"] == "bns" else {"prior.world": "mujoco"}
    return batches.columns(
        runs=runs,
        trials=ONSET + AFTER,
        **{"world.damage": damage, "compiled": "no", **model, **told},
    )
