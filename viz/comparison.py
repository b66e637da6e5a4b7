"""Several batches side by side: key figures, tests against the first, settings."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from bns import stats
from bns.experiment.loading import to_mapping
from bns.experiment.record import RunRecord
from bns.viz.facts import Facts, interval


def table(runs: Mapping[str, RunRecord]) -> dict:
    """Header and rows of the comparison.

    Every batch is tested against the first on trials to recover (on trials to solve
    where nothing was damaged): two-sided Mann-Whitney p, Holm's adjustment over the
    rows, and A12, the probability that a run of the row takes longer than one of the
    first batch.
    """
    facts = [Facts.of(record, label) for label, record in runs.items()]
    waits = [_waits(record) for record in runs.values()]
    raw = [_p(waits[0], other) for other in waits[1:]]
    known = [value for value in raw if value is not None]
    adjusted = iter(stats.holm(known) if known else ())
    rows = [[*_figures(facts[0]), "first", "", ""]]
    for fact, other, p in zip(facts[1:], waits[1:], raw, strict=True):
        tests = ["-", "-", "-"]
        if p is not None:
            effect = stats.a12(other, waits[0])
            tests = [
                _show_p(p),
                _show_p(float(next(adjusted))),
                f"{effect.value:.2f} ({effect.low:.2f} to {effect.high:.2f})",
            ]
        rows.append([*_figures(fact), *tests])
    header = (
        "batch, runs, solved, trials to solve, recovered, trials to recover, p, "
        "p (Holm), A12 against the first"
    )
    return {"header": header.split(", "), "rows": rows}


def differences(runs: Mapping[str, RunRecord]) -> dict:
    """Settings that are not the same in all batches, one row each."""
    flat = [_flat(to_mapping(record.config)) for record in runs.values()]
    keys = sorted({key for settings in flat for key in settings})
    rows = []
    for key in keys:
        values = [settings.get(key, "-") for settings in flat]
        if any(value != values[0] for value in values):
            rows.append([key, *(text(value) for value in values)])
    return {"header": ["setting", *runs], "rows": rows}


def _figures(fact: Facts) -> list[str]:
    damaged = fact.onset is not None
    return [
        fact.label,
        str(fact.runs),
        str(fact.solved),
        _short(interval(fact.to_solve)),
        str(fact.recovered) if damaged else "-",
        _short(interval(fact.to_recover)) if damaged else "-",
    ]


def _short(text: str) -> str:
    return text.replace("95 % interval ", "")


def _waits(record: RunRecord) -> np.ndarray:
    back = stats.trials_to_recover(record)
    back = back[~np.isnan(back)]
    return back if len(back) else stats.trials_to_solve(record)


def _p(first: np.ndarray, other: np.ndarray) -> float | None:
    if len(first) == 0 or len(other) == 0:
        return None
    return stats.mann_whitney(first, other)


def _show_p(p: float) -> str:
    return "< 0.0001" if p < 1e-4 else f"{p:.4f}"


def _flat(tree: Mapping, prefix: str = "") -> dict:
    found: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{prefix}{key}.")
        else:
            found[prefix + key] = value
    return found


def text(value: object) -> str:
    """A setting's value as a reader would write it."""
    if isinstance(value, list | tuple):
        return " + ".join(map(str, value)) or "none"
    return str(value)
