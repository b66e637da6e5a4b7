"""Configurations by name: one TOML file each, only what differs from the defaults.

A file may start from another preset (`preset` at its top), as any TOML file of a run.
"""

from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from bns.errors import UnknownNameError
from bns.experiment.config import RunConfig


@cache
def names() -> tuple[str, ...]:
    """The presets that exist, sorted."""
    entries = files(__name__).iterdir()
    return tuple(
        sorted(
            e.name.removesuffix(".toml") for e in entries if e.name.endswith(".toml")
        )
    )


def describe(name: str) -> str:
    """What the preset is, in one line."""
    return str(_content(name)["description"])


def load(name: str) -> RunConfig:
    """The configuration of a preset.

    Raises:
        UnknownNameError: there is no such preset.
    """
    from bns.experiment.loading import from_document

    return replace(from_document(_content(name)), preset=name)


def _content(name: str) -> dict[str, Any]:
    from bns.experiment.loading import read_toml

    if name not in names():
        raise UnknownNameError("preset", name, names())
    return read_toml(Path(str(files(__name__) / f"{name}.toml")))
