"""`bns report`: one self-contained HTML file on one or more runs."""

from dataclasses import dataclass
from pathlib import Path

from bns.cli.fields import Positional
from bns.cli.parse import parse
from bns.errors import BnsError
from bns.progress import working

TITLE = b" - BNS report</title>"  # of every page that `bns report` makes
MARK = 4096  # [bytes] from the beginning, within which a page has its title


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Write a report on runs: one HTML file that opens offline."""

    directories: Positional[tuple[str, ...]]
    """run directories, finished or not"""
    out: str = ""
    """file to write; without it report.html in the first directory"""
    force: bool = False
    """replace a file that `bns report` did not make"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code.

    Args:
        verb: "report".
        argv: words after it.

    Raises:
        BnsError: no run is given, a run without a trial, or a file at the report's
            place that is not one.
    """
    given = parse(Arguments, argv, prog="bns report")
    if not given.directories:
        raise BnsError("No run was given: give one or more run directories.")
    from bns.cli.outputs import REPORT, write_report
    from bns.storage.store import load

    directories = [Path(directory) for directory in given.directories]
    for directory in directories:
        if load(directory).trials == 0:
            raise BnsError(f"{directory} has no trial yet: let it run for a while.")
    path = Path(given.out) if given.out else directories[0] / REPORT
    if not given.force and path.exists() and not ours(path):
        raise BnsError(
            f"{path} was not made by `bns report`: add --force to replace it, or give "
            "another --out."
        )
    with working("drawing the report"):
        write_report(directories, path)
    print(path)
    return 0


def ours(path: Path) -> bool:
    """Whether a file says that a report of this project is in it."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return TITLE in file.read(MARK)
