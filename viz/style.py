"""Colours and plot settings that all pictures share; figures whose texts fit.

Colours are those of Okabe and Ito (2008), which stay apart for the three common
kinds of colour blindness; lightness differs too, so that they survive grey print. On a
telephone panels stand below each other and lines are broken.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.text import Text

BLACK = "#222222"
GREY = "#7a7a7a"
BLUE = "#0072B2"
ORANGE = "#E69F00"
GREEN = "#009E73"
VERMILION = "#D55E00"
PURPLE = "#CC79A7"
SKY = "#56B4E9"
YELLOW = "#F0E442"

CYCLE = (BLUE, ORANGE, GREEN, PURPLE, VERMILION, SKY, BLACK)
"""Colours of runs that are compared, in order."""

BEFORE, DAMAGED, AFTER = BLUE, VERMILION, GREEN
"""Colours of the three moments of a run: before damage, just damaged, recovered."""

DAMAGE = VERMILION
"""Colour of the mark at which damage begins."""

_RC: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.8,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "figure.dpi": 100,
    "savefig.dpi": 150,
    "figure.facecolor": "white",
    "svg.fonttype": "path",
    "svg.hashsalt": "bns",
}


class Size(NamedTuple):
    """Width and height of a figure [inch]."""

    width: float
    height: float


WIDE = Size(7.0, 3.1)
SQUARE = Size(7.0, 4.4)


@contextmanager
def plotting() -> Iterator[Any]:
    """Matplotlib without a display, in the common style; yields `Figure`.

    Figures are made from the class, never through pyplot, so that nothing is kept
    alive and threads do not meet.
    """
    import matplotlib

    with matplotlib.rc_context(_RC):
        yield _figure_class()


@cache
def _figure_class() -> Any:
    """Matplotlib's figure, which a notebook shows where it is a cell's last value."""
    from matplotlib.figure import Figure

    class Shown(Figure):
        def _repr_png_(self) -> bytes:
            buffer = io.BytesIO()
            self.savefig(buffer, format="png")
            return buffer.getvalue()

    return Shown


def logarithmic(axis: "Axis", set_scale: Any) -> None:
    """A logarithmic axis with plain numbers.

    Args:
        axis: of which data are drawn.
        set_scale: of the same axis, `Axes.set_xscale` or `Axes.set_yscale`.
    """
    from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

    set_scale("log")
    low, high = sorted(axis.get_view_interval())
    subs = (1.0, 2.0, 5.0) if high / max(low, 1e-300) < 300 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter("{x:g}")


def rgb(colour: str) -> tuple[int, int, int]:
    """The three bytes of ``#rrggbb``."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


NARROW = 3.8
"""width of a figure for a telephone [inch]"""

ROW = 1.35
"""height of a panel below others, at least [inch]"""

INSIDE = 0.6
"""share of a panel's width above which its legend is put below the figure"""

EDGE = 4.0
"""room that texts keep from the edge of a figure [pixel]"""


def stack(figure: "Figure") -> None:
    """Bring panels beside each other below each other, on a narrow figure.

    Panels in rows and columns come column by column.
    """
    width, height = figure.get_size_inches()
    places = [(axes, axes.get_subplotspec()) for axes in figure.axes]
    rows = {place.rowspan.start for _, place in places if place}
    columns = {place.colspan.start for _, place in places if place}
    if len(columns) < 2 or not all(place for _, place in places):
        shown = min(1.0, NARROW / width)
        least = max(NARROW * 0.8, ROW * len(rows) + 0.9)
        figure.set_size_inches(NARROW, max(height * shown, min(height, least)))
    else:
        _below(figure, len(rows))
    fit(figure)


def _below(figure: "Figure", rows: int) -> None:
    """All panels of a figure in one column."""
    from matplotlib.gridspec import GridSpec

    width, height = figure.get_size_inches()
    panels = sorted(figure.axes, key=_column_first)
    first = {_column_first(axes)[1]: axes for axes in reversed(panels)}
    ratio = panels[0].get_position().height * height
    ratio /= max(panels[0].get_position().width * width, 0.1)
    each = NARROW * min(ratio, 1.0) * 0.85 + 0.7
    if rows > 1:
        each = min(each, ROW + 0.3)
    labels = [first[_column_first(axes)[1]].get_ylabel() for axes in panels]
    last = [_column_first(axes)[1] == rows - 1 for axes in panels]
    figure.set_size_inches(NARROW, each * len(panels))
    grid = GridSpec(len(panels), 1, figure)
    for number, (axes, label) in enumerate(zip(panels, labels, strict=True)):
        axes.set_subplotspec(grid[number])
        axes.tick_params(labelleft=True, labelbottom=last[number])
        axes.set_ylabel(axes.get_ylabel() or label)


def _column_first(axes: "Axes") -> tuple[int, int]:
    place: Any = axes.get_subplotspec()
    return place.colspan.start, place.rowspan.start


def fit(figure: "Figure") -> None:
    """Break lines that are too long for a figure, and legends that are too wide."""
    width, height = figure.canvas.get_width_height()
    for axes in figure.axes:
        _moved(axes)
    figure.draw_without_rendering()
    for legend in list(figure.legends):
        _narrowed(figure, legend, width)
    figure.draw_without_rendering()
    for axes in figure.axes:
        _broken(axes.xaxis.label, width, upright=False)
        _broken(axes.yaxis.label, height / _rows(figure), upright=True)
        for title in _titles(axes):
            _broken(title, width, upright=False)


def _moved(axes: "Axes") -> None:
    """The legend of a panel put below the figure, where it would hide the panel."""
    legend, place, figure = axes.get_legend(), axes.get_subplotspec(), axes.figure
    if legend is None or place is None:
        return
    whole: Any = figure
    room = place.get_position(whole).width * whole.bbox.width
    if legend.get_window_extent().width <= INSIDE * room:
        return
    handles, labels = _shown(legend)
    legend.remove()
    _put(figure, handles, labels, len(labels))


def _shown(legend: "Legend") -> tuple[list, list[str]]:
    """Handles and labels of a legend."""
    return legend.legend_handles, [text.get_text() for text in legend.get_texts()]


def _put(figure: Any, handles: list, labels: list[str], columns: int) -> "Legend":
    """A legend below the panels."""
    place = "outside lower center"
    return figure.legend(handles, labels, loc=place, ncols=columns, frameon=False)


def _titles(axes: "Axes") -> "list[Text]":
    from matplotlib.text import Text

    every = [child for child in axes.get_children() if isinstance(child, Text)]
    return [text for text in every if text not in axes.texts]


def _rows(figure: "Figure") -> int:
    places = [axes.get_subplotspec() for axes in figure.axes]
    return max((place.get_gridspec().nrows for place in places if place), default=1)


def _narrowed(figure: "Figure", legend: "Legend", width: float) -> None:
    """The legend with as many columns as there is room for, at last in lines."""
    handles, labels = _shown(legend)
    columns = len(labels)
    while columns > 1 and legend.get_window_extent().width > width - 2 * EDGE:
        columns -= 1
        legend.remove()
        legend = _put(figure, handles, labels, columns)
        figure.draw_without_rendering()
    for text in legend.get_texts():
        _broken(text, width, upright=False)


def _broken(text: "Text", room: float, *, upright: bool) -> None:
    """A text in as many lines as it takes; a name is broken after an underscore.

    Args:
        text: one line.
        room: [pixel].
        upright: whether it is read from below.
    """
    said = text.get_text()
    if not said or "\n" in said:
        return
    box = text.get_window_extent()
    low, high = (box.y0, box.y1) if upright else (box.x0, box.x1)
    if upright:
        fits = high - low <= room - 2 * EDGE
    else:
        fits = low >= EDGE and high <= room - EDGE
        middle = (low + high) / 2
        centred = text.get_horizontalalignment() == "center"
        room = 2 * min(middle, room - middle) if centred else room - low
    if fits:
        return
    letters = len(said) * (room - 2 * EDGE) / (high - low)
    lines = wrap(said.replace("_", "_ "), max(int(np.floor(letters)), 8))
    text.set_text("\n".join(line.replace("_ ", "_") for line in lines))
