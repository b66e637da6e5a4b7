"""The dissertation's claims A15-A18: a sliding window against none, four damages."""

from bench import experiments, solving
from bench.result import Result, bench
from bns import stats

CLAIMS = dict(zip(experiments.DAMAGES, ("A15", "A16", "A17", "A18"), strict=True))
LEVEL = 0.01


@bench(
    "window 150 and 300 against none on four damages (claims A15-A18): cells that hold",
    bar="better in all 8 cells, p < 0.01 each",
)
def window_claims(quick: bool) -> Result:
    """30 runs a side, damage at trial 30 of 100; O of eq 3.1, Mann-Whitney, A12."""
    sides = {
        (damage, window): experiments.damaged(damage, **_adaptation(window))
        for damage in experiments.DAMAGES
        for window in (0, 150, 300)
    }
    records = experiments.records(sides.values(), quick=quick)
    cells: dict[str, dict[str, object]] = {}
    for damage, claim in CLAIMS.items():
        found = {w: records[sides[damage, w].preset] for w in (0, 150, 300)}
        for window in (150, 300):
            cell = solving.versus(found[window], found[0])
            cells[f"{claim} {damage} {window} v none"] = cell
        label = f"{claim} {damage} 150 v 300"
        cells[label] = solving.versus(found[150], found[300])
    adjusted = stats.holm([float(cell["p"]) for cell in cells.values()])
    for cell, p in zip(cells.values(), adjusted, strict=True):
        cell["p holm"] = float(p)
    against_none = [cell for name, cell in cells.items() if name.endswith("none")]
    hold = sum(cell["better"] > 0.5 and cell["p"] < LEVEL for cell in against_none)
    return Result(
        figure=hold,
        unit="cells of 8",
        holds=None if quick else hold == len(against_none),
        n=next(iter(records.values())).replicates,
        details=cells,
    )


def _adaptation(window: int) -> dict[str, int]:
    return {"window": window} if window else {}
