"""Errors that teach: what was given, what is allowed, what to do.

Every error a user can cause derives from `BnsError`; the command line prints it
on one line and exits with code 2, without a traceback.
"""

import shutil
import sys
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from pathlib import Path

LONGEST = 400
"""characters of a message; what is longer loses its middle"""

ALIKE = 0.55
"""how alike a name must be to be what was meant, 0 to 1 (`difflib`)"""


class BnsError(ValueError):
    """Base of every error that a user's input can cause: one short line of text."""

    def __init__(self, message: object = ""):
        super().__init__(one_line(str(message)))


def one_line(text: str, longest: int = LONGEST) -> str:
    """Text without control characters, its middle left out where it is too long."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    line = " ".join(plain.split())
    if len(line) <= longest:
        return line
    end = longest // 3
    return f"{line[: longest - end - 5]} ... {line[-end:]}"


class UnknownNameError(BnsError):
    """A name that no registry holds: the one that was meant, or else all there are.

    Args:
        kind: what was looked up, in singular ("effect", "preset", "world").
        given: the name that was given.
        known: the names that exist; what has none, such as a free joint, is called "".
        also: a sentence on what else may be given.
    """

    def __init__(self, kind: str, given: str, known: Iterable[str], also: str = ""):
        self.kind, self.given, self.known = kind, given, sorted(filter(None, known))
        close = get_close_matches(given, self.known, n=1, cutoff=ALIKE)
        end = f" {also}" if also else ""
        said = f"Unknown {kind} {one_line(given, 60)!r}."
        if close:
            super().__init__(f"{said} Did you mean {close[0]!r}?{end}")
            return
        if not self.known:
            super().__init__(f"{said} There is none.{end}")
            return
        said += " Available: "
        room = LONGEST - len(said) - len(end) - len(", ... (10000 in all).")
        listed, left = ", ".join(self.known), len(self.known)
        if len(listed) > room:
            listed = (
                f"{listed[: max(room, 0)].rpartition(', ')[0]}, ... ({left} in all)"
            )
        super().__init__(f"{said}{listed}.{end}")


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
        shown = f" {unit}" if unit not in ("", "1", name) else ""
        super().__init__(
            f"{name} = {given}{shown} is not allowed: "
            f"give a number from {_plain(low)} to {_plain(high)}{shown}."
        )


def _plain(value: float) -> str:
    """A bound as a person writes it: a count of 1000000 is not 1e+06."""
    return f"{value}" if isinstance(value, int) else f"{value:g}"


class FormatError(BnsError):
    """A file or directory that is not what it should be; nothing was changed."""


def install(extra: str) -> str:
    """The command that adds an extra of bns-testbed to the Python that runs.

    `pip` alone where that is this Python's own, else this Python by its path.
    """
    here, pip = Path(sys.executable), shutil.which("pip")
    own = pip is not None and Path(pip).absolute().parent == here.parent
    if here.is_relative_to(Path.cwd()):
        here = here.relative_to(Path.cwd())
    return f"{'pip' if own else f'{here} -m pip'} install 'bns-testbed[{extra}]'"


EXTRAS = {
    "torch": "learn",
    "matplotlib": "report",
    "pyarrow": "tables",
    "rerun": "view",
    "gymnasium": "gym",
    "dm_env": "dm",
    "mcap": "mcap",
    "ray": "ray",
    "serial": "hardware",
    "cv2": "hardware",
    "dynamixel_sdk": "hardware",
    "imageio_ffmpeg": "video",
}
"""module that may be missing -> extra of bns-testbed that brings it"""


def refused(names: Iterable[str], use: Callable[[str], object]) -> dict[str, BnsError]:
    """Names that can not be used, and what is wrong with each.

    Args:
        names: that are tried.
        use: fails for such a name.
    """
    found = {}
    for name in names:
        try:
            use(name)
        except BnsError as error:
            found[name] = error
        except ModuleNotFoundError as error:
            found[name] = BnsError(f"{name!r}: {missing(error)}")
    return found


def missing(error: ModuleNotFoundError) -> str:
    """What to do about a module that is not installed; "" where it is not ours to say.

    Args:
        error: that was raised by its import.
    """
    name = (error.name or "").partition(".")[0]
    if name not in EXTRAS:
        return ""
    return f"This needs {name}: {install(EXTRAS[name])}"


class MissingDependencyError(BnsError):
    """An optional package or system library that a feature needs.

    Args:
        feature: what needs it.
        package: what is missing.
        install: the command that installs it.
    """

    def __init__(self, feature: str, package: str, install: str):
        super().__init__(f"{feature} needs {package}, which is missing: {install}")
