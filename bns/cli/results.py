"""`bns report`, `compare` and `export`: what runs say, and their data elsewhere."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bns.cli.fields import Positional
from bns.cli.parse import parse
from bns.cli.tables import show
from bns.errors import BnsError
from bns.progress import counting

TITLE = b" - BNS report</title>"  # of every page that `bns report` makes
MARK = 4096  # [bytes] from the beginning, within which a page has its title


@dataclass(frozen=True, kw_only=True)
class Report:
    """Write a report on runs: one HTML file that opens offline."""

    directories: Positional[tuple[str, ...]]
    """run directories, finished or not"""
    out: str = ""
    """file to write; without it report.html in the first directory"""
    force: bool = False
    """replace a file that `bns report` did not make"""


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Compare runs: medians with 95 % intervals, how many solved and recovered, and
    for each pair Mann-Whitney p (as the dissertation computes it), Holm's adjusted p
    over the pairs of a measure, and A12 with its 95 % interval.
    """

    directories: Positional[tuple[str, ...]]
    """two or more run directories"""
    json: bool = False
    """print JSON instead of tables"""


@dataclass(frozen=True, kw_only=True)
class Export:
    """Write the trials of a run or dataset for other tools. lerobot: a LeRobotDataset
    (version 2.1), an episode a trial, frames at a fixed rate. parquet: one table, a row
    per sample as it was recorded. `bns gap describe` reads the former back.
    """

    data: Positional[str]
    """directory of a run or of a dataset"""
    to: Literal["lerobot", "parquet"] = "lerobot"
    """what to write"""
    out: str = ""
    """directory or file to write (default: lerobot, or samples.parquet)"""
    fps: int = 0
    """lerobot: frames a second; 0 = as the samples have it"""
    task: str = ""
    """lerobot: what the robot did, a sentence"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code."""
    if verb == "report":
        return _report(parse(Report, argv, prog="bns report"))
    if verb == "compare":
        return _compare(parse(Compare, argv, prog="bns compare"))
    return _export(parse(Export, argv, prog="bns export"))


def _report(given: Report) -> int:
    if not given.directories:
        raise BnsError("No run was given: give one or more run directories.")
    from bns.cli.outputs import DRAWING, REPORT, write_report
    from bns.storage.store import load

    directories = [Path(directory) for directory in given.directories]
    for directory in directories:
        if load(directory).trials == 0:
            raise BnsError(f"{directory} has no trial yet: let it run for a while.")
    path = Path(given.out) if given.out else directories[0] / REPORT
    if path.suffix not in (".html", ".htm"):
        raise BnsError(f"{path} is no HTML: give an --out that ends in .html.")
    if not given.force and path.exists() and not ours(path):
        raise BnsError(
            f"{path} was not made by `bns report`: add --force to replace it, or give "
            "another --out."
        )
    with counting(DRAWING) as each:
        write_report(directories, path, each=each)
    print(path)
    return 0


def ours(path: Path) -> bool:
    """Whether a file says that a report of this project is in it."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return TITLE in file.read(MARK)


def _compare(given: Compare) -> int:
    from bns.stats.compare import A12, MEASURES, compare
    from bns.storage.store import load

    with counting("comparing") as each:
        found = compare([load(path) for path in each(given.directories)], each=each)
    if given.json:
        print(json.dumps(found.to_mapping(), indent=2))
        return 0
    head = ["run", "measure", "runs", "reached", "median", "95 % interval"]
    rows = [
        [
            s.name,
            s.measure,
            f"{s.runs}",
            f"{s.reached}",
            text(s.median.value),
            span(s.median),
        ]
        for s in found.sides
    ]
    show(head, rows, json=False)
    head = ["a", "b", "measure", "p", "p (Holm)", "A12", "95 % interval"]
    rows = [
        [
            q.a,
            q.b,
            q.measure,
            f"{q.p:.5f}",
            f"{q.p_holm:.5f}",
            text(q.a12.value),
            span(q.a12),
        ]
        for q in found.pairs
    ]
    show(head, rows, json=False)
    for measure in dict.fromkeys(s.measure for s in found.sides):
        print(f"{measure}: {MEASURES[measure]}")
    print(A12)
    for note in found.notes:
        print(f"Note: {note}")
    return 0


def text(value: float) -> str:
    """A number to read: "never" for infinity."""
    return "never" if value == float("inf") else f"{value:.4g}"


def span(interval: tuple[float, float, float]) -> str:
    """An interval to read."""
    if interval[1] == float("-inf"):
        return "too few runs"
    if interval[1] == float("inf"):
        return text(interval[1])
    return f"{text(interval[1])} to {text(interval[2])}"


def _export(given: Export) -> int:
    from bns.worlds.data import dataset, export

    if given.to == "parquet" and (given.fps or given.task):
        raise BnsError("--fps and --task are for --to lerobot: leave them out.")
    inside = Path(given.data) / "dataset"
    data = dataset.read(inside if inside.is_dir() else given.data)
    if given.to == "parquet":
        path = export.table(data, given.out or "samples.parquet")
    else:
        path = export.lerobot(
            data, given.out or "lerobot", fps=given.fps, task=given.task
        )
    print(f"{len(data)} trials of {data.robot}: {path}")
    return 0
