"""A plan in words."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import norm

from bns.gap.records import Diagnosis

if TYPE_CHECKING:
    from bns.gap.planning.plan import Option


def nothing(found: Diagnosis) -> str:
    """Why there is nothing to plan."""
    said = {
        "no gap": "no gap was found",
        "none of the library": "no effect of the library explains the gap",
    }
    reason = said.get(found.verdict.kind, "one explanation stands alone")
    return f"Nothing is tied: {reason}."


def sentence(
    names: Sequence[tuple[str, ...]],
    steps: Sequence[tuple["Option", int]],
    open_: np.ndarray,
    alike: Sequence[tuple[int, int]],
) -> str:
    """What to run, and what it will tell.

    Args:
        names: of the tied explanations.
        steps: options and how often to run each; 0 = it is no use.
        open_: which pairs some command parts, ``(pairs,)``.
        alike: pairs that no command parts.
    """
    words = [" + ".join(name) for name in names]
    tied_ = " or ".join(words)
    best, count = steps[0]
    if not count:
        return (
            f"Tied: {tied_}. No safe command of the family tells them apart (the best, "
            f"{best.excitation.name}, by {best.distances.max():.2g} deviations): they "
            "do the same whatever is commanded. Observe another quantity."
        )
    runs = ", and ".join(
        f"{_often(count)}: {option.excitation.name} "
        f"({option.excitation.commands.duration:.0f} s)"
        for option, count in steps
    )
    squares = sum(count * option.distances[open_] ** 2 for option, count in steps)
    parted = np.sqrt(squares)
    wrong = norm.sf(parted / 2).mean()
    text = (
        f"Tied: {tied_}. Run {runs}; {'that' if len(steps) > 1 else 'it'} parts them "
        f"by {parted.min():.2g} deviations (expected log Bayes factor "
        f"{parted.min() ** 2 / 2:.3g}, wrong one named {100 * wrong:.2g} %)."
    )
    for first, second in alike:
        text += f" No command parts {words[first]} from {words[second]}."
    return text


def _often(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")
