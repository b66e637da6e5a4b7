"""A decomposition in words: how large the gap is, what explains it, what is left."""

from collections.abc import Iterable, Sequence

from bns.gap.decomposition.shares import Part
from bns.worlds.trial import Channel

WORDS = {"m": ("mm", 1e3), "rad": ("mrad", 1e3)}
LISTED = 4  # alternatives in a sentence


def sized(sizes: Iterable[float], channels: Sequence[Channel]) -> str:
    """Sizes of features in units that are read, "1.2 mm forward"."""
    found = []
    for value, channel in zip(sizes, channels, strict=True):
        unit, factor = WORDS.get(channel.unit, (channel.unit, 1.0))
        found.append(f"{factor * value:.2g} {unit} {channel.name}")
    return ", ".join(found)


def size(
    before: Iterable[float],
    beyond: Iterable[float],
    channels: Sequence[Channel],
    window: float,
) -> str:
    """First statement: how large the gap is beyond what measuring scatters.

    Args:
        before: size of the gap by feature, in its unit.
        beyond: the same without what measuring scatters.
        channels: the features.
        window: length of a window [s].
    """
    return (
        f"Recorded and predicted motion differ by {sized(before, channels)} over "
        f"{window:.2g} s; beyond what measuring scatters that is "
        f"{sized(beyond, channels)}."
    )


def part(found: Part, unit: str, main: str) -> str:
    """One explanation with its magnitude and share.

    Args:
        found: the explanation.
        unit: of its main number; "1" = none.
        main: name of the row that is said.
    """
    value = found.values.get(main, 0.0)
    shown = "" if unit == "1" else f" {unit}"
    low, high = found.low.get(main, value), found.high.get(main, value)
    return (
        f"{found.name} = {value:.4g}{shown} [{low:.4g}, {high:.4g}] "
        f"({_percent(found.last)} of it)"
    )


def explained(
    parts: Sequence[str], closed: float, onset: str, tied: Sequence[str]
) -> str:
    """Second statement: what explains how much of it.

    Args:
        parts: texts of the explanations, as `part` gives them.
        closed: share of the gap that they close, held out.
        onset: sentence on when it set in; "" = none.
        tied: names of rivals that the data cannot tell from it.
    """
    if not parts:
        return "No effect of the library explains any of it."
    text = f"{' and '.join(parts)} {'explains' if len(parts) == 1 else 'explain'} "
    text += f"{_percent(closed)} of the gap on motion that was not fitted."
    if onset:
        text += f" {onset}"
    if tied:
        more = f" or {len(tied) - LISTED} more" if len(tied) > LISTED else ""
        text += f" These data cannot tell it from {' or '.join(tied[:LISTED])}{more}."
    return text


def left(share: float, lasting: bool, recurs: bool, sizes: str) -> str:
    """Third statement: how large the rest is, and whether it recurs.

    Args:
        share: of the gap that is left.
        lasting: whether it is more than a sound robot and its camera scatter.
        recurs: whether it is the same whenever the motion is.
        sizes: how large it is, in words.
    """
    if not lasting:
        return "What is left does not recur: the robot scatters it, or the camera."
    how = "recurs" if recurs else "is more than a sound robot scatters"
    return (
        f"What is left, {_percent(share)} of the gap, {how} and is explained by no "
        f"effect of the library: about {sizes}."
    )


def _percent(share: float) -> str:
    value = 100 * min(max(share, -1.0), 1.0)
    return f"{value:.0f} %" if abs(value) >= 1 else f"{value:.1f} %"
