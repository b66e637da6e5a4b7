"""Errors that teach: what was given, what is allowed, what to do.

Every error a user can cause derives from `BnsError`; the command line prints it
on one line and exits with code 2, without a traceback.
"""

from collections.abc import Iterable
from difflib import get_close_matches


class BnsError(ValueError):
    """Base of every error that a user's input can cause."""


class UnknownNameError(BnsError):
    """A name that no registry holds: the one that was meant, or else all there are.

    Args:
        kind: what was looked up, in singular ("effect", "preset", "world").
        given: the name that was given.
        known: the names that exist.
        also: a sentence on what else may be given, where nothing is alike.
    """

    def __init__(self, kind: str, given: str, known: Iterable[str], also: str = ""):
        self.kind, self.given, self.known = kind, given, sorted(known)
        close = get_close_matches(given, self.known, n=1, cutoff=0.5)
        end = f" {also}" if also else ""
        super().__init__(
            f"Unknown {kind} {given!r}. Did you mean {close[0]!r}?"
            if close
            else f"Unknown {kind} {given!r}. Available: {', '.join(self.known)}.{end}"
        )


class OutOfBoundsError(BnsError):
    """A number outside its declared bounds, or not finite.

    Args:
        name: the quantity, as the user wrote it.
        given: the value that was given.
        low: smallest value allowed.
        high: largest value allowed.
        unit: unit of all three.
    """

    def __init__(self, name: str, given: object, low: float, high: float, unit: str):
        shown = f" {unit}" if unit and unit != "1" else ""
        super().__init__(
            f"{name} = {given}{shown} is not allowed: "
            f"give a number from {low:g} to {high:g}{shown}."
        )


class FormatError(BnsError):
    """A file or directory that is not what it should be; nothing was changed."""


class MissingDependencyError(BnsError):
    """An optional package or system library that a feature needs.

    Args:
        feature: what needs it.
        package: what is missing.
        install: the command that installs it.
    """

    def __init__(self, feature: str, package: str, install: str):
        super().__init__(f"{feature} needs {package}, which is missing: {install}")
