"""HTML pages that need no other file: their templates and the pictures in them."""

import base64
import io
from collections.abc import Mapping
from typing import Any

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


def picture(figure) -> str:
    """A figure as a `data:` address of an SVG, the same bytes every time."""
    buffer = io.BytesIO()
    with style.plotting():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()
