"""What an effect can be set to: bounded numbers with units, and named choices."""

from dataclasses import dataclass

import numpy as np

from bns.errors import OutOfBoundsError, UnknownNameError


@dataclass(frozen=True)
class Parameter:
    """A number that says how strong an effect is.

    Attributes:
        name: as written in text (`factor`).
        unit: SI unit, "1" for a ratio.
        nominal: the value at which the effect changes nothing (given the others).
        low, high: bounds, inclusive.
        doc: meaning in one line, with the source of the bounds or "assumed".
        example: a value that makes the effect clearly felt (used by contract tests
            and listings).
        integer: whether only whole numbers make sense.
        scales: whether severity scales it; False for what is no strength but a place
            or kind (a position, a direction), which stays as given.
        quiet: whether the nominal value is left out of the effect's text.
    """

    name: str
    unit: str
    nominal: float
    low: float
    high: float
    doc: str
    example: float
    integer: bool = False
    scales: bool = True
    quiet: bool = False

    def check(self, effect: str, value: object) -> float:
        """The value as a float inside the bounds.

        Raises:
            OutOfBoundsError: not a number, not finite, or outside the bounds.
        """
        try:
            number = float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            number = float("nan")
        whole = not self.integer or number == np.floor(number)
        if not (np.isfinite(number) and self.low <= number <= self.high and whole):
            unit = "" if self.unit == "1" else f"{self.unit} "
            unit = f"{unit}(whole numbers only)" if self.integer else self.unit
            raise OutOfBoundsError(
                f"{effect}:{self.name}", value, self.low, self.high, unit
            )
        return number


def factor(
    bounds: tuple[float, float], doc: str, *, example: float, scales: bool = True
) -> Parameter:
    """A ratio to the nominal value: at 1 the effect changes nothing.

    Args:
        bounds: inclusive.
        doc, example, scales: see `Parameter`.
    """
    return Parameter("factor", "1", 1.0, *bounds, doc, example, scales=scales)


def strength(
    name: str,
    unit: str,
    bounds: tuple[float, float],
    doc: str,
    *,
    example: float,
    integer: bool = False,
    scales: bool = True,
    quiet: bool = False,
) -> Parameter:
    """A number that is 0 where the effect changes nothing.

    Args:
        bounds: inclusive.
        name, unit, doc, example, integer, scales, quiet: see `Parameter`.
    """
    return Parameter(name, unit, 0.0, *bounds, doc, example, integer, scales, quiet)


def place(
    name: str, unit: str, nominal: float, bounds: tuple[float, float], doc: str
) -> Parameter:
    """A number that says where or how and not how strongly: no severity scales it.

    Args:
        bounds: inclusive.
        name, unit, nominal, doc: see `Parameter`.
    """
    return Parameter(name, unit, nominal, *bounds, doc, nominal, scales=False)


@dataclass(frozen=True)
class Choice:
    """A setting with named alternatives (`wheel` = left, right, both).

    Attributes:
        name: as written in text.
        options: the alternatives.
        default: the one taken where none is given.
        doc: meaning in one line.
        quiet: whether the default is left out of the effect's text.
    """

    name: str
    options: tuple[str, ...]
    default: str
    doc: str
    quiet: bool = False

    @property
    def shown(self) -> str:
        """The alternatives for a listing."""
        return ", ".join(self.options)

    def check(self, effect: str, value: object) -> str:
        """The value, one of the options.

        Raises:
            UnknownNameError: it is none of them.
        """
        if value not in self.options:
            raise UnknownNameError(f"{effect}:{self.name}", str(value), self.options)
        return str(value)
