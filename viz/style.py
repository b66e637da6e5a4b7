"""Colours and plot settings that all pictures share.

Colours are those of Okabe and Ito (2008), which stay apart for the three common
kinds of colour blindness; lightness differs too, so that they survive grey print.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from matplotlib.axis import Axis

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
