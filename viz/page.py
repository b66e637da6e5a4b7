"""HTML pages that need no other file: their templates and the pictures in them."""

import base64
import io
from collections.abc import Mapping
from typing import Any, NamedTuple

from bns.viz import style

NARROW = 3.8
"""width of a figure for a telephone [inch]"""


def render(template: str, content: Mapping[str, Any]) -> bytes:
    """A page.

    Args:
        template: name of a file in `templates`.
        content: what it shows; all that it names must be there.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("bns.viz", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(content).encode()


class Picture(NamedTuple):
    """A figure in a page, as `data:` addresses of SVGs.

    Attributes:
        wide: panels beside each other.
        narrow: panels below each other, for a telephone.
    """

    wide: str
    narrow: str


def picture(figure: Any) -> Picture:
    """A figure in two layouts, the same bytes every time; the figure is used up."""
    wide = _address(figure)
    _stack(figure)
    return Picture(wide, _address(figure))


def portrait(robot: str) -> str:
    """The picture beside a robot's model as a `data:` address; "" where there is none.

    Args:
        robot: its name or its directory.
    """
    from bns.errors import BnsError
    from bns.models.robot_model import find

    try:
        directory = find(robot)
    except BnsError:  # a run of another machine, whose robot is not here
        return ""
    file = directory / f"{directory.name}.png"
    if not file.is_file():
        return ""
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode()


def _address(figure: Any) -> str:
    buffer = io.BytesIO()
    with style.plotting():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()


def _stack(figure: Any) -> None:
    """Panels beside each other brought below each other, on a narrow figure."""
    from matplotlib.gridspec import GridSpec

    width, height = figure.get_size_inches()
    places = [(axes, axes.get_subplotspec()) for axes in figure.axes]
    rows = {place.rowspan.start for _, place in places if place}
    beside = [axes for axes, place in places if place]
    shown = min(1.0, NARROW / width)
    if len(beside) < 2 or len(rows) > 1 or len(beside) < len(figure.axes):
        figure.set_size_inches(NARROW, max(height * shown, min(height, NARROW * 0.8)))
        return
    ratio = beside[0].get_position().height * height
    ratio /= max(beside[0].get_position().width * width, 0.1)
    tall = NARROW * min(ratio, 1.0) * 0.85 + 0.7
    figure.set_size_inches(NARROW, tall * len(beside))
    grid = GridSpec(len(beside), 1, figure)
    for number, axes in enumerate(beside):
        axes.set_subplotspec(grid[number])
        axes.tick_params(labelleft=True, labelbottom=True)
        axes.set_ylabel(axes.get_ylabel() or beside[0].get_ylabel())
    for legend in list(figure.legends):
        handles = legend.legend_handles
        labels = [text.get_text() for text in legend.get_texts()]
        legend.remove()
        place = "outside lower center"
        figure.legend(handles, labels, loc=place, ncols=2, frameon=False)
