"""HTML pages that need no other file: their templates and the pictures in them."""

import base64
import io
from collections.abc import Mapping
from typing import Any, NamedTuple

from bns.viz import style


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
    with style.plotting():
        style.fit(figure)
        wide = _address(figure)
        style.stack(figure)
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
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()
