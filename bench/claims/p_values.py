"""The dissertation's p values from their U statistics.

Its tables print p to five decimals for thirty runs against thirty. U is whole where
there are no ties, so a printed p has one U that gives it, or none if it was computed
otherwise. A p that prints as 0.00000 is given by every U far enough from the middle.
"""

import csv
from pathlib import Path

import numpy as np

from bench.result import Result, bench
from bns import stats

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
