"""The design of claims, simulated: how often it finds what is not there, and what is.

Every simulated comparison goes through the code that judges claims, look by look. Sides
are drawn from what runs give: costs, and trials to recover of which a part is "never",
so that most values may be ties; and costs of sides that share their trials before the
damage, which makes them alike run by run.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from bench.result import Result, bench
from bns import seeding
from bns.claims import verdict
from bns.claims.claim import Cell
from bns.stats.equivalence import MARGIN

MANY, FEW = 4000, 200
LARGE = 0.71  # a large effect, after Vargha and Delaney
SHIFT = 0.7826  # of a normal distribution by which A12 is 0.71
LEVEL, POWER = 0.05, 0.8

Draw = Callable[[np.random.Generator], tuple[np.ndarray, np.ndarray]]


@bench(
    "a difference found where there is none, over looks at 10 to 100 runs a side",
    bar="<= 5 % at worst; power >= 80 % at A12 = 0.71; no difference shown at "
    "0.64 <= 5 %",
)
def sequential_design(quick: bool) -> Result:
    """Each case so many times: the worst level, the least power."""
    many = FEW if quick else MANY
    level = {name: judged(name, ">", draw, many) for name, draw in SAME.items()}
    found = {name: judged(name, ">", draw, many) for name, draw in APART.items()}
    alike = {name: judged(name, "=", draw, many) for name, draw in EDGE.items()}
    shown = {name: judged(name, "=", draw, many) for name, draw in SAME.items()}
    wrong = max(row["difference"] for row in level.values())
    power = min(row["holds"] for row in found.values())
    edge = max(row["holds"] for row in alike.values())
    holds = wrong <= LEVEL and power >= POWER and edge <= LEVEL
    return Result(
        figure=100 * wrong,
        unit="% type I",
        holds=None if quick else holds,
        n=many,
        details={
            "least power at A12 = 0.71 [%]": 100 * power,
            f"'no difference' shown at A12 = {0.5 + MARGIN:.2f}, at most [%]": 100
            * edge,
            "no difference there": level,
            "A12 = 0.71": found,
            "claimed 'no difference', A12 at the margin": alike,
            "claimed 'no difference', none there": shown,
        },
    )


def judged(name: str, says: str, draw: Draw, many: int) -> dict[str, float]:
    """Shares of verdicts over simulated comparisons, and the runs they took."""
    cell = Cell(a="a", b="b", says=says)
    design = verdict.design(cell)
    rng = seeding.generator(0, "sequential-design", name, says)
    rows = [verdict.examine(cell, *draw(rng), design) for _ in range(many)]
    runs = np.array([row.runs[0] for row in rows])
    return {
        "difference": float(np.mean([row.p < LEVEL for row in rows])),
        "holds": float(np.mean([row.verdict == "holds" for row in rows])),
        "runs a side, mean": float(runs.mean()),
        **{f"stopped at {n}": float(np.mean(runs == n)) for n in design.looks},
    }


def costs(
    rng: np.random.Generator, *, shift: float = 0.0, alike: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Costs of two sides, more is better; `alike` is the correlation of paired runs."""
    shared = rng.normal(size=100) * np.sqrt(alike)
    own = rng.normal(size=(2, 100)) * np.sqrt(1 - alike)
    return np.exp(shared + own[0] + shift), np.exp(shared + own[1])


def waits(
    rng: np.random.Generator, *, first: float, second: float
) -> tuple[np.ndarray, np.ndarray]:
    """Less trials to recover, less infinity for never; the parts that recover differ.

    Those that recover take alike long, so A12 is one half and half the difference.
    """
    trials = rng.geometric(0.1, size=(2, 100)).astype(float)
    there = rng.uniform(size=(2, 100)) < np.array([[first], [second]])
    mine, other = np.where(there, -trials, -np.inf)
    return mine, other


GAP = 2 * (LARGE - 0.5)
EDGE_GAP = 2 * MARGIN
SAME: dict[str, Draw] = {
    "costs": costs,
    "costs, paired, correlation 0.5": partial(costs, alike=0.5),
    **{
        f"{100 * p:.0f} % recover": partial(waits, first=p, second=p)
        for p in (0.97, 0.67, 0.33, 0.1, 0.03, 0.0)
    },
}
"""sides that do not differ"""
APART: dict[str, Draw] = {
    "costs": partial(costs, shift=SHIFT),
    **{
        f"{100 * (p + GAP):.0f} % against {100 * p:.0f} % recover": partial(
            waits, first=p + GAP, second=p
        )
        for p in (0.0, 0.29, 0.58)
    },
}
"""sides whose A12 is 0.71"""
EDGE: dict[str, Draw] = {
    "costs": partial(costs, shift=0.5069),
    **{
        f"{100 * (p + EDGE_GAP):.0f} % against {100 * p:.0f} % recover": partial(
            waits, first=p + EDGE_GAP, second=p
        )
        for p in (0.0, 0.36, 0.72)
    },
}
"""sides whose A12 is that of the margin"""
