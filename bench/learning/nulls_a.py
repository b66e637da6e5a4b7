"""The dissertation's nulls of investigation A, and three claims beside them.

A9, A11-A13, A23 say "no difference"; A8 and A21 say a loss; A24 says when improvement
begins without a window. Reported as they come out.
"""

import numpy as np

from bench.learning import experiments, solving
from bench.result import Result, bench
from bns.experiment.record import RunRecord

LEVEL = 0.05

RATE, MAGNITUDE = 0.2, 3500.0  # dissertation, table 4.1


def _sides() -> dict[str, tuple[dict[str, object], dict[str, object], str]]:
    """Claim -> adaptation, what it is compared with, damage."""
    reset = {"population_reset": True}
    rate, size = {"mutation_rate_after": RATE}, {"mutation_magnitude_after": MAGNITUDE}
    fresh = {"simulator_reset": True}
    return {
        "A8 population reset, left-20": (reset, {}, "left-20"),
        "A9 population reset, right-20": (reset, {}, "right-20"),
        "A9 population reset, left-50": (reset, {}, "left-50"),
        "A9 population reset, right-50": (reset, {}, "right-50"),
        "A11 mutation rate 0.2": (rate, {}, "left-20"),
        "A12 mutation magnitude 3500": (size, {}, "left-20"),
        "A13 both": (rate | size, {}, "left-20"),
        "A21 simulator reset": (fresh, {}, "left-20"),
        "A23 window 150 + simulator reset": (
            fresh | {"window": 150},
            {"window": 150},
            "left-20",
        ),
    }


NULLS = ("A9", "A11", "A12", "A13", "A23")


@bench(
    "nulls A9, A11-A13, A23, claims A8, A21 and A24's onset: nulls found null",
    bar="none: reported as they come out",
)
def nulls_a(quick: bool) -> Result:
    """30 runs a side; O of eq 3.1, Mann-Whitney, share of pairs won with interval."""
    sides = _sides()
    configs = {
        (damage, tuple(sorted(adaptation.items()))): experiments.damaged(
            damage, **adaptation
        )
        for one, other, damage in sides.values()
        for adaptation in (one, other)
    }
    records = experiments.records(configs.values(), quick=quick)

    def of(damage: str, adaptation: dict[str, object]) -> RunRecord:
        return records[configs[damage, tuple(sorted(adaptation.items()))].preset]

    cells = {
        claim: solving.versus(of(damage, one), of(damage, other))
        for claim, (one, other, damage) in sides.items()
    }
    null = [c for name, c in cells.items() if name.split()[0] in NULLS]
    plain = of("left-20", {})
    details = {**cells, "A21 cost just after": drop(of, plain), "A24": onset(plain)}
    return Result(
        figure=sum(cell["p"] >= LEVEL for cell in null),
        unit=f"nulls of {len(null)}",
        holds=None,
        n=plain.replicates,
        details=details,
    )


def drop(of, plain: RunRecord) -> dict[str, float]:
    """Median cost over the ten trials after the damage, with and without a reset."""
    after = slice(int(plain.damage_onset[0]) + 1, int(plain.damage_onset[0]) + 11)
    fresh = of("left-20", {"simulator_reset": True})
    return {
        "reset": float(np.median(fresh["fitness_best"][:, after])),
        "none": float(np.median(plain["fitness_best"][:, after])),
    }


def onset(plain: RunRecord) -> dict[str, float | None]:
    """A24: first trial at which the mean cost has made up a fifth of its rise.

    The claim: without a window nothing improves until patterns of the damaged robot
    outnumber the old ones, about trial 60 for damage at 30. The mean over runs is
    smoothed over five trials.
    """
    start = int(plain.damage_onset[0])
    mean = plain["fitness_best"].mean(0)
    before = mean[max(0, start - 10) : start].mean()
    smooth = np.convolve(mean[start:], np.ones(5) / 5, mode="valid")
    peak = smooth.max()
    low = np.flatnonzero(smooth <= peak - 0.2 * (peak - before))
    late = low[low > smooth.argmax()]
    return {
        "cost before": float(before),
        "worst after": float(peak),
        "cost at the end": float(smooth[-1]),
        "onset of improvement [trial]": float(late[0] + start) if len(late) else None,
    }
