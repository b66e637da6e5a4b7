"""The picture that leads docs/claims.md: how many claims have which verdict."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bns.claims.claim import INVESTIGATIONS
from bns.claims.report import NOT_RUN, NOT_TESTED, STALE, Judged, counts
from bns.storage import files
from bns.viz import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


COLOURS = {
    "holds": style.GREEN,
    "direction only": style.SKY,
    "null": style.YELLOW,
    "reversed": style.VERMILION,
    STALE: "#b5b5b5",
    NOT_RUN: "#d9d9d9",
    NOT_TESTED: "#f2f2f2",
}
BAR, GAP = 0.34, 0.42


def figure(worlds: Mapping[str, Sequence[Judged]]) -> "Figure":
    """A bar for each investigation and world, a colour for each verdict.

    Args:
        worlds: name of the world -> all claims, judged.
    """
    with style.plotting() as figure_class:
        size = (style.WIDE.width, 0.42 * len(INVESTIGATIONS) * len(worlds) + 1.1)
        made = figure_class(figsize=size, layout="constrained")
        axes = made.subplots()
        places, names = [], []
        for row, letter in enumerate(INVESTIGATIONS):
            for line, (world, rows) in enumerate(worlds.items()):
                place = -row - line * GAP
                part = [each for each in rows if each.claim.investigation == letter]
                _bar(axes, place, counts(part))
                places.append(place)
                names.append(f"{letter}, {world}")
        axes.set_yticks(places, names)
        axes.grid(axis="y", visible=False)
        axes.set_xlabel("claims")
        handles = [axes.barh([0], [0], color=c, edgecolor=style.GREY, linewidth=0.5)
                   for c in COLOURS.values()]  # fmt: skip
        made.legend(
            handles, list(COLOURS), loc="outside upper center", ncols=len(COLOURS)
        )
        return made


def write(worlds: Mapping[str, Sequence[Judged]], path: Path) -> None:
    """Write the picture.

    Raises:
        StorageError: no space, or no permission.
    """
    files.make_directory(path.parent)
    files.replace(path, lambda part: figure(worlds).savefig(part, format="png"))


def _bar(axes: "Axes", place: float, found: Mapping[str, int]) -> None:
    left = 0
    for name, count in found.items():
        if not count:
            continue
        axes.barh(
            [place], [count], BAR, left=left, color=COLOURS[name],
            edgecolor=style.GREY, linewidth=0.5,
        )  # fmt: skip
        axes.text(left + count / 2, place, str(count), ha="center", va="center")
        left += count
