"""What the best explanation leaves, in words and in the units of the motion."""

import numpy as np

from bns.gap.core.fit import Point
from bns.gap.core.model_order import Rung
from bns.gap.core.problem import Problem

WORDS = {"m": (1e3, "mm"), "rad": (180 / np.pi, "deg")}  # unit -> factor, shown as


def sizes(problem: Problem, best: Point, rung: Rung) -> np.ndarray:
    """Root mean square by feature of the part of a rest that has structure, ``(C,)``.

    Args:
        problem: the recording.
        best: what leaves the rest.
        rung: how much of its loss has structure.
    """
    parts = [
        (factor @ best.rest[rows]).reshape(-1, len(problem.model.features))
        for factor, rows in zip(
            problem.whiten.factors, problem.whiten.rows, strict=True
        )
    ]
    share = min(rung.excess / max(rung.loss, 1e-9), 1.0)
    return np.sqrt(share * (np.concatenate(parts) ** 2).mean(axis=0))


def text(problem: Problem, best: Point, rung: Rung) -> str:
    """One sentence on it: its share of the gap, and how far it moves the robot.

    Args:
        problem: the recording.
        best: the best support.
        rung: what is known of its size.
    """
    window = float(np.median(np.concatenate([w.durations for w in problem.windows])))
    found = []
    for value, channel in zip(
        sizes(problem, best, rung), problem.model.features, strict=True
    ):
        factor, unit = WORDS.get(channel.unit, (1.0, channel.unit))
        found.append(f"{value * factor:.2g} {unit} {channel.name}")
    share = rung.excess / max(rung.explained, rung.excess, 1e-9)
    return (
        f"What is left has structure (p = {rung.p_misfit:.2g}) that no effect of the "
        f"library explains, {share:.2g} of what is explained: about "
        f"{', '.join(found)} in {window:.2g} s."
    )
