"""Scores of the withheld-effect bench, from the rows that its runner writes."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise, permutations
from typing import Any

import numpy as np

from bns.gap.bench.cases import Case
from bns.gap.bench.wheeled_cases import WheeledStand
from bns.gap.edit import errors
from bns.gap.models.base import GapModel
from bns.gap.records import Diagnosis
from bns.worlds.effects import registry

LARGE = 3.0  # sizes from which effects have to be named


def row(kind: str, seed: int, case: Case, found: Diagnosis) -> dict[str, Any]:
    """A case and what was said of it, as plain data.

    Args:
        kind: of case.
        seed: of it.
        case: with the true answer.
        found: the diagnosis.
    """
    said = said_of(asdict(found))
    said["intervals"] = _intervals(found, case.answer.names)
    return {"kind": kind, "seed": seed, "answer": case.answer.as_dict(), "said": said}


def refused(kind: str, seed: int, case: Case, why: str) -> dict[str, Any]:
    """A case of which nothing was said: it has no verdict, and names nothing.

    Args:
        kind: of case.
        seed: of it.
        case: with the true answer.
        why: the error's text.
    """
    said = {"error": why, "named": [], "sets": [], "parts": []}
    return {"kind": kind, "seed": seed, "answer": case.answer.as_dict(), "said": said}


def edited(found: Diagnosis, case: Case, model: GapModel) -> dict[str, float]:
    """Take the first true effect away; predict a recording with the second alone.

    Args:
        found: the diagnosis of a pair.
        case: with the true answer.
        model: nominal model, of a wheeled robot.
    """
    first, second = (registry.parse(text) for text in case.answer.effects)
    alone = WheeledStand(model).record(case.commands, [*case.reality, second], 7)
    best = [model.parse(text) for text in found.best.effects]
    sets = {
        "ours": [effect for effect in best if effect.name != first.name],
        "oracle": [second],
    }
    return errors(alone, model, sets)


def said_of(found: Mapping[str, Any]) -> dict[str, Any]:
    """What a diagnosis says, without its fits.

    Args:
        found: the diagnosis as plain data; what it leaves out is not scored.
    """
    verdict = found["verdict"]
    made = {key: verdict[key] for key in ("named", "sets", "p_gap", "p_misfit")}
    parts = found.get("decomposition", {}).get("parts", ())
    return {
        **made,
        "verdict": verdict["kind"],
        "ranked": found["signatures"].get("ranked", []),
        "faults": found.get("faults", ()),
        **{key: found["closed"].get(key) for key in ("closed", "before", "after")},
        "parts": [part["name"] for part in parts],
        "left": found.get("decomposition", {}).get("left"),
        "recurs": found.get("decomposition", {}).get("recurs"),
        "seconds": dict(found.get("seconds", {})),
    }


def _intervals(found: Diagnosis, names: Sequence[str]) -> list[list[float]]:
    """Value and 90 % interval of each true effect, where just these were fitted."""
    for fit in found.fits:
        if set(fit.names) == set(names) and names:
            order = [fit.names.index(name) for name in names]
            return [[fit.magnitudes[at], *fit.intervals[at]] for at in order]
    return []


def matches(names: Sequence[str], answer: dict[str, Any]) -> bool:
    """Whether a support is the true one, effects that look alike merged.

    Merged are those that the recording cannot tell apart, and those that none can.

    Args:
        names: of the support.
        answer: see `cases.Answer`.
    """
    classes = [set(row) for row in answer["aliases"]]
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


def share(
    rows: Sequence[dict[str, Any]], holds: Callable[[dict[str, Any]], bool]
) -> float:
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
    return bool(row["said"].get("verdict") != "no gap")


def strange(row: dict[str, Any]) -> bool:
    """Whether a gap is claimed that no effect of the library explains."""
    return bool(row["said"]["verdict"] == "none of the library")


def unexplained(row: dict[str, Any]) -> bool:
    """Whether it is said that something is left that no effect of the library explains,
    be it most of the gap or not."""
    from bns.gap.decomposition.rest import SURE

    return strange(row) or (row["said"]["recurs"] or 0.0) > SURE


def confusion(rows: Sequence[dict]) -> dict[str, int]:
    """Counts of "true effect -> named effect", effects without their sides."""
    counts: Counter[str] = Counter()
    for row in rows:
        named = row["said"]["named"]
        first = "+".join(named[0]) if named else row["said"]["verdict"]
        counts[f"{'+'.join(row['answer']['names']) or row['kind']} -> {first}"] += 1
    return dict(counts.most_common())


def failures(
    rows: Sequence[dict[str, Any]], holds: Callable[[dict[str, Any]], bool]
) -> list[str]:
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
        median error over the true magnitude's departure from the middle of nothing,
        which is the magnitude itself but for ratios, of which 1 is nothing; share of
        90 % intervals that hold the truth.
    """
    errors, held = [], []
    for row in rows:
        truth, found = row["answer"]["magnitudes"], row["said"]["intervals"]
        names = row["answer"]["effects"]
        if len(truth) != len(found):
            continue
        for true, (value, low, high), text in zip(truth, found, names, strict=True):
            nominal = 1.0 if "factor=" in text else 0.0
            errors.append(abs(value - true) / max(abs(true - nominal), 1e-12))
            held.append(low <= true <= high)
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
