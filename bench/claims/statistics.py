"""The statistics of claims: printed p values given back, and the design simulated.

Its tables print p to five decimals for thirty runs against thirty. U is whole where
there are no ties, so a printed p has one U that gives it, or none if it was computed
otherwise. A p that prints as 0.00000 is given by every U far enough from the middle.

How often the design finds what is not there, and what is:
Every simulated comparison goes through the code that judges claims, look by look. Sides
are drawn from what runs give: costs, and trials to recover of which a part is "never",
so that most values may be ties; and costs of sides that share their trials before the
damage, which makes them alike run by run.
"""

import csv
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from bench.result import Result, bench
from bns import seeding, stats
from bns.claims import verdict
from bns.claims.claim import Cell
from bns.stats.designs import MARGIN

TABLES = Path(__file__).with_name("p_values.csv")
RUNS, MIDDLE = 30, 450
OWN_ROUTINE = "4."  # tables of investigation A, from another publication
ZERO = "0.00000"


@bench(
    "p values of investigations B, C, D that a whole U gives back to five decimals",
    bar="166 of 166",
)
def p_values(quick: bool) -> Result:
    """Every cell of every table, through the test that the package uses."""
    del quick  # it takes a second
    with open(TABLES, newline="") as file:
        cells = list(csv.DictReader(file))
    printed = {_printed(distance): distance for distance in range(MIDDLE + 1)}
    found = {name: [] for name in ("exact", "zero", "none")}
    for cell in cells:
        kind = "zero" if cell["p"] == ZERO else "exact"
        found[kind if cell["p"] in printed else "none"].append(cell)
    ours = [c for c in cells if not c["table"].startswith(OWN_ROUTINE)]
    wrong = [c for c in ours if c in found["none"]]
    details = {
        "cells in all tables": len(cells),
        "p above 0 from one whole U": len(found["exact"]),
        "p printed as 0.00000, from any U at least so far from 450": len(found["zero"]),
        "smallest such distance": _farthest(),
        "no whole U (all of table 4.3)": [_name(cell) for cell in found["none"]],
        "of those, from a U with some ties": [
            _name(cell) for cell in found["none"] if _with_ties(cell["p"])
        ],
        "B, C, D: from one whole U": len([c for c in ours if c in found["exact"]]),
        "B, C, D: printed as 0.00000": len([c for c in ours if c in found["zero"]]),
    }
    return Result(
        figure=len(ours) - len(wrong),
        unit=f"of {len(ours)}",
        holds=len(ours) == 166 and not wrong,
        n=len(ours),
        details=details,
    )


def samples(u: int) -> tuple[np.ndarray, np.ndarray]:
    """Two samples without ties of which the first has the statistic `u`."""
    other = np.arange(RUNS, dtype=float)
    above = np.minimum(RUNS, np.maximum(0, u - RUNS * np.arange(RUNS)))
    return above - 0.5 + np.linspace(0, 1e-3, RUNS), other


def _printed(distance: int) -> str:
    """p as printed for a U this far from the middle."""
    return f"{stats.mann_whitney(*samples(MIDDLE + distance)):.5f}"


def _farthest() -> int:
    return next(d for d in range(MIDDLE) if stats.p_of_u(MIDDLE + d, 30, 30) < 5e-6)


def _with_ties(printed: str) -> bool:
    """Whether a U in steps of one half, with up to ten equal values, gives the p."""
    from scipy import special

    count = 2 * RUNS
    for same in range(2, 11):
        lost = (same**3 - same) / (count * (count - 1))
        spread = np.sqrt(RUNS * RUNS / 12 * (count + 1 - lost))
        z = (np.arange(2 * MIDDLE + 1) / 2 - 0.5) / spread
        if printed in {f"{p:.5f}" for p in 2 * special.ndtr(-z)}:
            return True
    return False


def _name(cell: dict[str, str]) -> str:
    return f"{cell['table']}: {cell['row']} v {cell['column']}, p {cell['p']}"


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
