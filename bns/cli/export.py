"""`bns export`: recordings for other tools."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bns.cli.fields import Positional
from bns.cli.parse import parse


@dataclass(frozen=True, kw_only=True)
class Arguments:
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
    """Run the verb; gives the exit code.

    Args:
        verb: "export".
        argv: words after it.

    Raises:
        BnsError: no dataset, or a place that is taken.
    """
    del verb
    given = parse(Arguments, argv, prog="bns export")
    from bns.worlds.data import dataset, export

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
