"""`bns compare`: two or more runs side by side."""

import json
from dataclasses import dataclass

from bns.cli.fields import Positional
from bns.cli.parse import parse
from bns.cli.tables import show


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Compare runs: medians with 95 % intervals, how many solved and recovered, and
    for each pair Mann-Whitney p (as the dissertation computes it), Holm's adjusted p
    over the pairs of a measure, and A12 with its 95 % interval.
    """

    directories: Positional[tuple[str, ...]]
    """two or more run directories"""
    json: bool = False
    """print JSON instead of tables"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code."""
    given = parse(Arguments, argv, prog="bns compare")
    from bns.stats.compare import MEASURES, compare
    from bns.storage.store import load

    found = compare([load(directory) for directory in given.directories])
    if given.json:
        print(json.dumps(found.to_mapping(), indent=2))
        return 0
    head = ["run", "measure", "runs", "reached", "median", "95 % interval"]
    rows = [
        [
            s.name,
            s.measure,
            f"{s.runs}",
            f"{s.reached}",
            text(s.median.value),
            span(s.median),
        ]
        for s in found.sides
    ]
    show(head, rows, json=False)
    head = ["a", "b", "measure", "p", "p (Holm)", "A12", "95 % interval"]
    rows = [
        [
            q.a,
            q.b,
            q.measure,
            f"{q.p:.5f}",
            f"{q.p_holm:.5f}",
            text(q.a12.value),
            span(q.a12),
        ]
        for q in found.pairs
    ]
    show(head, rows, json=False)
    for measure in dict.fromkeys(s.measure for s in found.sides):
        print(f"{measure}: {MEASURES[measure]}")
    print("A12: probability that a's value is larger than b's, ties counted half")
    return 0


def text(value: float) -> str:
    """A number to read: "never" for infinity."""
    return "never" if value == float("inf") else f"{value:.4g}"


def span(interval: tuple[float, float, float]) -> str:
    """An interval to read."""
    if interval[1] == float("-inf"):
        return "too few runs"
    return f"{text(interval[1])} to {text(interval[2])}"
