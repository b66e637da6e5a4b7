"""Scores of the withheld-effect bench, from the rows that its runner writes."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise, permutations
from typing import Any

import numpy as np

from bns.gap.bench import baselines
from bns.gap.bench.cases import Case, record
from bns.gap.candidates import wheeled
from bns.gap.core import fit, model_order, select, verdict
from bns.gap.core.gap_closure import edit_error
from bns.gap.core.problem import Problem
from bns.gap.core.uncertainty import half_width, spreads, standard_error
from bns.gap.diagnose import Analysis, report
from bns.gap.models.base import GapModel
from bns.worlds.effects import registry

LARGE = 3.0  # sizes from which effects have to be named


def said(made: Analysis, case: Case, model: GapModel) -> dict[str, Any]:
    """What a diagnosis said of a case, the oracle and the baselines, as plain data.

    Args:
        made: analysis of the case.
        case: with the true answer.
        model: nominal model that was diagnosed with.
    """
    answer, problem = case.answer, made.problem
    found = report(made)
    choice = made.choice
    row = {
        "verdict": found.verdict.kind,
        "named": found.verdict.named,
        "sets": found.verdict.sets,
        "p_gap": found.verdict.p_gap,
        "left": choice.left,
        "rungs": [rung.as_dict() for rung in choice.rungs],
        "size": choice.rung.size,
        "residuals": len(problem.rest),
        "worth": choice.worth,
        "ranked": found.signatures["ranked"],
        "faults": found.faults,
        "closed": found.closed.get("closed"),
        "before": found.closed.get("before"),
        "after": found.closed.get("after"),
        "best": found.signatures["best"],
        "loss": {"+".join(fit.names): fit.loss for fit in found.fits},
        "held_out": {"+".join(fit.names): fit.held_out for fit in found.fits},
        "magnitudes": _magnitudes(made, answer.names),
        "seconds": found.seconds,
    }
    if answer.kind in ("single", "pair"):
        row["oracle"] = _oracle(problem, case, model.candidates())
    if answer.kind == "pair" and choice.rung.size:
        row["edit"] = _edit(choice.best, case, model)
    if answer.kind in ("single", "none"):
        row["baselines"] = baselines.name(problem, made.curves)
    return row


def _oracle(problem: Problem, case: Case, candidates) -> float:
    by_name = {item.name: item for item in candidates}
    terms = []
    for name, text, magnitude in zip(
        case.answer.names, case.answer.effects, case.answer.magnitudes, strict=True
    ):
        item, values = by_name[name], registry.parse(text).values
        term = fit.Term.at(item, _branch(item, values), magnitude)
        extras = tuple(float(values[extra]) for extra in item.extras)
        terms.append(replace(term, extras=extras))
    held_out = select.held_out(problem, fit.refine(problem, terms))[0]
    return held_out / len(problem.rest)


def _branch(item, values) -> int:
    for number, branch in enumerate(item.branches):
        if all(values[k] == v for k, v in branch.items() if isinstance(v, str)):
            return number
    return 0


def judged(row: dict[str, Any], rules: verdict.Calibration) -> dict[str, Any]:
    """A row with the verdict that a calibration gives."""
    said = row["said"]
    if "rungs" not in said:
        return row
    rungs = [model_order.Rung.from_dict(content) for content in said["rungs"]]
    rung = model_order.climb(rungs, said["worth"], rules)
    kind, named, sets = verdict.judge(rung, said["p_gap"], rules)
    spans = intervals(said, row["answer"]["names"], rules)
    changed = {"verdict": kind, "named": named, "sets": sets, "size": rung.size}
    return {**row, "said": {**said, **changed, "intervals": spans}}


def intervals(
    said: dict[str, Any], names: Sequence[str], rules: verdict.Calibration
) -> list[list[float]]:
    """Value, half interval and nominal value of each true effect that was fitted.

    Args:
        said: what was said of the case, as `said` gives it.
        names: true effects, in the answer's order.
        rules: thresholds and widths of intervals.
    """
    made = []
    for name, found in zip(names, errors(said, rules), strict=False):
        value, error, nominal = found
        half = half_width(error, *described(name), rules)
        made.append([value, half, nominal])
    return made


def errors(
    said: dict[str, Any], rules: verdict.Calibration
) -> list[tuple[float, float, float]]:
    """Value, standard error and nominal value of each true effect that was fitted."""
    return [
        (value, standard_error(deviation, value - nominal, rules), nominal)
        for value, deviation, nominal in said["magnitudes"]
    ]


@cache
def described(name: str) -> tuple[str, str]:
    """Effect and unit of a wheeled candidate; of another one the effect alone."""
    units = {item.name: item.unit for item in wheeled.candidates()}
    return name.split("[")[0].split(".")[0], units.get(name, "")


def _magnitudes(made: Analysis, names: Sequence[str]) -> list[list[float]]:
    """Of the support that is true, where it was fitted, in the answer's order."""
    for points in made.search.sizes:
        for point in points:
            if set(point.names) == set(names):
                found = [
                    [term.magnitude, deviation, term.candidate.nominal]
                    for term, deviation in zip(
                        point.terms, spreads(made.problem, point)[0], strict=True
                    )
                ]
                return [found[point.names.index(name)] for name in names]
    return []


def _edit(best: fit.Point, case: Case, model: GapModel) -> dict[str, float]:
    """Take the first true effect away; predict a recording with the second alone."""
    first, second = (registry.parse(text) for text in case.answer.effects)
    alone = record(case.commands, [*case.reality, second], 7, model.name)
    effects = [term.effect() for term in best.terms]
    ours = edit_error(alone, model, effects, first.name)["edited"]
    oracle = edit_error(alone, model, [first, second], first.name)["edited"]
    return {"ours": ours, "oracle": oracle}


@cache
def _always() -> dict[str, tuple[str, ...]]:
    """Wheeled candidates that look alike whatever is commanded."""
    return {item.name: item.aliases for item in wheeled.candidates()}


def matches(
    names: Sequence[str], answer: dict[str, Any], *, angle: float = 0.0
) -> bool:
    """Whether a support is the true one, effects that look alike merged.

    Merged are those that the recording cannot tell apart, and those that none can.

    Args:
        names: of the support.
        answer: see `cases.Answer`.
        angle: between whitened signatures [deg] below which effects are merged, too.
    """
    always = _always()
    classes = [
        {*row, *(other for name in row for other in always.get(name, ()))}
        for row in answer["aliases"]
    ]
    for near, found in zip(answer.get("near", ()), classes, strict=False):
        found.update(name for name, _, apart in near if apart < angle)
    if len(names) != len(classes):
        return False
    return any(
        all(name in row for name, row in zip(order, classes, strict=True))
        for order in permutations(names)
    )


def merged(row: dict[str, Any]) -> int:
    """Size of the 90 % set with the true effect's aliases counted as one."""
    sets = row["said"]["sets"]
    right = sum(matches(names, row["answer"]) for names in sets)
    return len(sets) - max(right - 1, 0)


def size(row: dict[str, Any]) -> float:
    """Size of the smallest hidden effect over what is detected."""
    return min(row["answer"]["sizes"], default=0.0)


def of(rows: Sequence[dict], kind: str, smallest: float = 0.0) -> list[dict]:
    """Rows of a kind whose effects are at least this large, errors left out.

    Args:
        rows: cases with what was said of them.
        kind: of case.
        smallest: least size of the effects that count.
    """
    return [
        row
        for row in rows
        if row["kind"] == kind
        and size(row) >= smallest
        and ("verdict" in row["said"] or kind == "fault")
    ]


def share(rows: Sequence[dict], holds) -> float:
    """Share of rows for which something holds; NaN if there are none."""
    return float(np.mean([bool(holds(row)) for row in rows])) if rows else float("nan")


def right(row: dict[str, Any]) -> bool:
    """Whether the first support that was named is the true one (aliases merged)."""
    named = row["said"]["named"]
    return bool(named) and matches(named[0], row["answer"])


def among(row: dict[str, Any]) -> bool:
    """Whether the true support is among those named (aliases merged)."""
    return any(matches(names, row["answer"]) for names in row["said"]["named"])


def strict(row: dict[str, Any]) -> bool:
    """Whether the first support named is the true one, aliases not merged."""
    named = row["said"]["named"]
    return bool(named) and sorted(named[0]) == sorted(row["answer"]["names"])


def covered(row: dict[str, Any]) -> bool:
    """Whether the true support is in the set."""
    names = sorted(row["answer"]["names"])
    return any(sorted(found) == names for found in row["said"]["sets"])


def listed(row: dict[str, Any]) -> bool:
    """Whether the true support is among those named."""
    names = sorted(row["answer"]["names"])
    return any(sorted(found) == names for found in row["said"]["named"])


def confident_wrong(row: dict[str, Any]) -> bool:
    """Whether one support was named alone and it is not exactly the true one."""
    return row["said"]["verdict"] in ("effect", "together") and not strict(row)


def aliased(row: dict[str, Any]) -> bool:
    """Whether the recording cannot tell the true effect from another."""
    return any(len(names) > 1 for names in row["answer"]["aliases"])


def claims(row: dict[str, Any]) -> bool:
    """Whether a gap is claimed."""
    return bool(row["said"]["verdict"] != "no gap")


def strange(row: dict[str, Any]) -> bool:
    """Whether a gap is claimed that no effect of the library explains."""
    return bool(row["said"]["verdict"] == "none of the library")


def confusion(rows: Sequence[dict]) -> dict[str, int]:
    """Counts of "true effect -> named effect", effects without their sides."""
    counts: Counter[str] = Counter()
    for row in rows:
        named = row["said"]["named"]
        first = "+".join(named[0]) if named else row["said"]["verdict"]
        counts[f"{'+'.join(row['answer']['names']) or row['kind']} -> {first}"] += 1
    return dict(counts.most_common())


def failures(rows: Sequence[dict], holds) -> list[str]:
    """One line per row for which something does not hold."""
    return [
        f"{row['kind']} {row['seed']}: {', '.join(row['answer']['effects'])} "
        f"(size {size(row):.2f}) -> {row['said']['verdict']} {row['said']['named']}"
        for row in rows
        if not holds(row)
    ]


def parameter(rows: Sequence[dict]) -> dict[str, float]:
    """Error of the true effect's magnitude where it was fitted.

    Returns:
        median error over the true departure from nominal; share of 90 % intervals
        that hold the truth.
    """
    errors, held = [], []
    for row in rows:
        truth, found = row["answer"]["magnitudes"], row["said"]["intervals"]
        if len(truth) != len(found):
            continue
        for true, (value, half, nominal) in zip(truth, found, strict=True):
            errors.append(abs(value - true) / max(abs(true - nominal), 1e-12))
            held.append(abs(value - true) <= half)
    if not errors:
        return {"median relative error": float("nan"), "intervals that hold": 0.0}
    return {
        "median relative error": float(np.median(errors)),
        "intervals that hold": float(np.mean(held)),
    }


def by_size(rows: Sequence[dict]) -> list[dict[str, float]]:
    """Accuracy and abstention by size of the effect."""
    edges = [0.0, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, np.inf]
    made = []
    for low, high in pairwise(edges):
        part = [row for row in rows if low <= size(row) < high]
        silent = share(part, lambda row: not row["said"]["named"])
        named = share(part, right)
        made.append({"from": low, "n": len(part), "named": named, "silent": silent})
    return made
