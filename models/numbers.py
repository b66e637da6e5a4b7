"""The numbers behind a robot model: value, unit, source, and where the model has them.

Each robot directory holds a `numbers.toml` with one table per number:

    [wheel_radius]
    value = 0.0205
    unit = "m"
    basis = "published"
    source = "Khepera III manual 2.2, p. 12: diameter 41 mm"
    at = { "geom left_wheel size 0" = 1, "geom right_wheel size 0" = 1 }

`at` names entries of the compiled model (kind, name, field, index) and what the value
is multiplied by there. A test compares the two.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from bns.errors import FormatError
from bns.storage import reading
from bns.storage.reading import Finite

Basis = Literal["published", "derived", "calibrated", "assumed"]


class Table(msgspec.Struct, forbid_unknown_fields=True):
    """A number in the file."""

    value: Finite | list[Finite]
    unit: str
    basis: Basis
    source: str
    at: dict[str, Finite]


@dataclass(frozen=True)
class Number:
    """One number of a robot model.

    Attributes:
        name: of the number.
        value: one number, or several (a position).
        unit: of the value.
        basis: "published" (somebody measured or stated it), "derived" (computed from
            other numbers here), "calibrated" (fitted to the robot's motion) or
            "assumed".
        source: who says so, how it was computed, or why it was assumed.
        at: entries of the compiled model and the factor of each.
    """

    name: str
    value: float | list[float]
    unit: str
    basis: str
    source: str
    at: Mapping[str, float]

    def disagreements(self, model: Any) -> list[str]:
        """Where a compiled `mujoco.MjModel` holds something else, one line each."""
        return [
            f"{self.name}: {where} is {found}, not {self.value} x {factor}"
            for where, factor in self.at.items()
            if not np.allclose(
                found := entry(model, where),
                np.multiply(self.value, factor),
                rtol=1e-9,
                atol=1e-12,
            )
        ]


def entry(model: Any, where: str) -> Any:
    """An entry of a compiled `mujoco.MjModel`, such as "geom floor friction 0".

    Raises:
        FormatError: the model has no such entry.
    """
    kind, *rest = where.split()
    try:
        if kind == "opt":
            return getattr(model.opt, rest[0])
        found = getattr(getattr(model, kind)(rest[0]), rest[1])
        return found[int(rest[2])] if len(rest) > 2 else found
    except (AttributeError, IndexError, KeyError, ValueError) as error:
        raise FormatError(f"The model has no entry {where!r} ({error}).") from error


def read(directory: Path) -> dict[str, Number]:
    """The numbers of a robot directory, by name.

    Raises:
        FormatError: the file is not TOML, an entry is missing, a basis is unknown.
    """
    file = directory / "numbers.toml"
    tables = reading.tables(reading.read_toml(file), Table, file)
    return {
        name: Number(name, t.value, t.unit, t.basis, t.source, t.at)
        for name, t in tables.items()
    }
