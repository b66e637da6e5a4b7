"""A verdict in words."""

from collections.abc import Sequence

from bns.gap.core.fit import Point

LISTED = 4  # supports named in a sentence at most


def text(point: Point) -> str:
    """A support with its magnitudes."""
    parts = [
        f"{term.candidate.name} ({term.candidate.parameter} = {term.magnitude:.4g}"
        f" {term.candidate.unit})".replace(" 1)", ")")
        for term in point.terms
    ]
    return " with ".join(parts)


def sentence(
    kind: str,
    best: Point,
    tied: Sequence[Point],
    between: float,
    p_gap: float,
    p_misfit: float,
) -> str:
    """The answer in words.

    Args:
        kind: see `Verdict`.
        best: the best support.
        tied: supports that cannot be told apart, best first.
        between: angle between the first two [deg].
        p_gap, p_misfit: see `Verdict`.
    """
    if kind == "no gap":
        return f"No gap beyond what the recording scatters by itself (p = {p_gap:.3g})."
    if kind == "none of the library":
        found = f"There is a gap (p = {p_gap:.2g}), and no effect of the library "
        if not best.terms:
            return found + "that explains it holds on trials that it was not fitted to."
        return (
            found + f"explains it: after the best, {text(best)}, the rest still has "
            f"structure (p = {p_misfit:.2g})."
        )
    if kind == "either":
        names = " or ".join(text(point) for point in tied[:LISTED])
        more = f" or {len(tied) - LISTED} more" if len(tied) > LISTED else ""
        return (
            f"Either {names}{more}: these data cannot tell (angle between the first "
            f"two {between:.1f} deg)."
        )
    if kind == "effect":
        return f"The gap is explained by {text(best)}."
    return f"The gap is explained by {text(best)} together."


def change(
    kind: str,
    best: Point,
    tied: Sequence[Point],
    second: tuple[str, ...],
    margin: float,
    excite: dict[str, str],
) -> str:
    """What would change the answer, in words.

    Args:
        kind: of the verdict.
        best: the best support.
        tied: supports that cannot be told from it.
        second: names of the next best support; () = none.
        margin: how much larger its loss is.
        excite: what a recording needs in order to show each effect, by name.
    """
    wanted = sorted({excite.get(n, "") for p in tied for n in p.names} - {""})
    if kind == "either":
        return f"A recording with {' and '.join(wanted)} may separate them."
    if kind == "no gap":
        return "A longer or less noisy recording would show smaller effects."
    if kind == "none of the library" and not best.terms:
        return "More trials, so that what explains one is tested on others."
    if kind == "none of the library":
        return "An effect that the library lacks; see where and when the gap sits."
    if not second:
        return "No other support that was fitted comes near."
    return f"Second best: {' with '.join(second)}, its loss larger by {margin:.1f}."
