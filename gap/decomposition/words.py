"""A decomposition in words: how large the gap is, what explains it, what is left, what
would tell more."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from bns.gap.decomposition.evidence.linear import Support
from bns.gap.decomposition.row import Row
from bns.gap.decomposition.shares import Part
from bns.worlds.effects.parts import ALL
from bns.worlds.trial import Channel

WORDS = {"m": ("mm", 1e3), "rad": ("mrad", 1e3)}
ANY = ("any command", "any drive")  # show it, for what that is worth
SAME = (
    "They do the same whatever is commanded: observe another quantity, or measure one "
    "of them."
)
NOR = " As few usual effects that [effects] does not list leave over half of it."
KINDS = 4  # of motion that a further recording is asked for
LISTED = 4  # alternatives, or channels, in a sentence


def sized(sizes: Sequence[float] | np.ndarray, channels: Sequence[Channel]) -> str:
    """Sizes of features, ``(C,)``, in units that are read, "1.2 mm forward"; of many
    the largest, none that is 0 beside others."""
    order = sorted(range(len(channels)), key=lambda n: -sizes[n])
    order = [n for n in order if sizes[n] > 0] or order
    kept = sorted(order[: LISTED if len(order) > LISTED + 1 else None])
    found = [_one(sizes[n], channels[n]) for n in kept]
    more = len(order) - len(kept)
    return ", ".join(found) + (f" and less in {more} more" if more else "")


def _one(value: float, channel: Channel) -> str:
    """A size with two digits, never as a power of ten where it need not be."""
    unit, factor = WORDS.get(channel.unit, (channel.unit, 1.0))
    if value >= 1.0:
        unit, factor = channel.unit, 1.0
    shown = float(f"{factor * value:.2g}")
    return f"{shown:.4g} {unit} {channel.name}"


def size(
    before: np.ndarray,
    beyond: np.ndarray,
    channels: Sequence[Channel],
    over: str,
) -> str:
    """First statement: how large the gap is beyond what measuring scatters.

    Args:
        before: size of the gap by feature, in its unit, ``(C,)``.
        beyond: the same, ``(C,)``, without what measuring scatters.
        channels: the features.
        over: in what time it has grown, in words.
    """
    return (
        f"Recorded and predicted motion differ by {sized(before, channels)} {over}; "
        f"beyond what measuring scatters that is {sized(beyond, channels)}."
    )


def part(
    found: Part,
    value: float,
    low: float,
    high: float,
    unit: str,
    beside: Sequence[str] = (),
    *,
    several: bool = False,
) -> str:
    """One explanation with its magnitude, and its share where it is one of several.

    Args:
        found: the explanation.
        value: its magnitude.
        low, high: 90 % interval of it.
        unit: of the magnitude; "1" = none.
        beside: further numbers of it, in words.
        several: whether there are others.
    """
    share = f" ({_percent(found.last)} when added last)" if several else ""
    shown = "" if unit == "1" else f" {unit}"
    return (
        f"{found.name} = {value:z.4g}{shown} [{low:z.4g}, {high:z.4g}]"
        f"{''.join(f', {text}' for text in beside)}{share}"
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


def left(share: float, lasting: bool, recurs: bool, sizes: str, goes: str) -> str:
    """Third statement: how large the rest is, and whether it recurs.

    Args:
        share: of the gap that is left.
        lasting: whether it is more than a sound robot and its camera scatter.
        recurs: whether it is the same whenever the motion is.
        sizes: how large it is, in words.
        goes: with what the gap goes that these explanations imitate; "" = nothing.
    """
    if goes:
        return (
            f"They imitate what the library lacks: a regression on {goes}, which knows "
            "no effect, predicts trials that it has not seen better."
        )
    if not lasting:
        return "What is left does not recur: the robot or its measurement scatters it."
    how = "recurs" if recurs else "is more than a sound robot scatters"
    return (
        f"What is left, {_percent(share)} of the gap, {how} and is explained by no "
        f"effect of the library: about {sizes}."
    )


def apart(tied: Sequence[Support], rows: Sequence[Row]) -> str:
    """Which further recording may separate explanations that these data cannot tell.

    Args:
        tied: sets of explanations, the best first.
        rows: numbers that may be off.
    """
    first, *others = tied
    by_term = {row.term: row for row in rows}
    unlike: set[str] = set()
    for other in others:
        left, right = first - other, other - first
        if not _alike(left, right, by_term):
            unlike |= left | right
    listed = ", ".join(sorted({_exciting(by_term[name]) for name in unlike} - {""}))
    pieces = [re.sub("^(and|or) ", "", piece) for piece in listed.split(", ") if piece]
    wanted = [piece for piece in dict.fromkeys(pieces) if piece not in ANY][:KINDS]
    if wanted:
        return f"A recording with {', '.join(wanted)} may separate them."
    if pieces:
        return "A longer or less noisy recording may separate them."
    return SAME


def _exciting(row: Row) -> str:
    """Which commands make a row felt, its joint by name."""
    part = row.fixed.get("part", ALL)
    return row.excite if part == ALL else row.excite.replace("that joint", str(part))


def _alike(left: Support, right: Support, rows: Mapping[str, Row]) -> bool:
    """Whether two explanations are known to do the same whatever is commanded."""
    if len(left) != 1 or len(right) != 1:
        return False
    (one,), (other,) = left, right
    return other in rows[one].aliases


def _percent(share: float) -> str:
    value = 100 * min(max(share, -1.0), 1.0)
    return f"{value:.0f} %" if abs(value) >= 1 else f"{value:.1f} %"
