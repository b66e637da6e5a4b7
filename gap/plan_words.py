"""A plan in words."""

from bns.gap.records import Diagnosis


def nothing(found: Diagnosis) -> str:
    """Why there is nothing to plan."""
    said = {
        "no gap": "no gap was found",
        "none of the library": "no effect of the library explains the gap",
    }
    reason = said.get(found.verdict.kind, "one explanation stands alone")
    return f"Nothing is tied: {reason}."


def sentence(names, best, open_, count: int, alike) -> str:
    """What to run, and what it will tell.

    Args:
        names: of the tied explanations.
        best: the option that was chosen.
        open_: which pairs some command parts, ``(pairs,)``.
        count: how often to run it; 0 = it is no use.
        alike: pairs that no command parts.
    """
    words = [" + ".join(name) for name in names]
    tied_ = " or ".join(words)
    if not count:
        return (
            f"Tied: {tied_}. No safe command of the family tells them apart (the best, "
            f"{best.excitation.name}, by {best.distances.max():.2g} deviations): they "
            "do the same whatever is commanded. Observe another quantity."
        )
    often = "once" if count == 1 else f"{count} times"
    parted = best.distances[open_]
    text = (
        f"Tied: {tied_}. Run {often}: {best.excitation.name} "
        f"({best.excitation.commands.duration:.0f} s); it parts them by "
        f"{parted.min():.2g} deviations (expected log Bayes factor "
        f"{parted.min() ** 2 / 2:.3g}, wrong one named {100 * best.wrong:.2g} %)."
    )
    for first, second in alike:
        text += f" No command parts {words[first]} from {words[second]}."
    return text
