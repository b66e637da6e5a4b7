"""What benches share: campaigns of small batches of real runs, drives, kept rows."""

import json
from collections.abc import Container
from pathlib import Path

import tomli_w

from bns.campaign.file import Campaign, from_content

DAMAGE = "wheel_gain:wheel=left,factor=0.8@2"


def tiny(members: int, *, trials: int = 4, replicates: int = 2) -> Campaign:
    """A campaign of so many members, each a batch of its own."""
    return from_content(content(members, trials=trials, replicates=replicates), "tiny")


def content(members: int, *, trials: int = 4, replicates: int = 2) -> dict[str, object]:
    """The same as the content of a campaign file."""
    return {
        "replicates": replicates,
        "batch_runs": replicates,
        "settings": {
            "trials": trials,
            "compiled": "no",
            "evolution": {"population": 10, "generations": 2},
            "snn": {"epochs": 3},
            "world": {"damage": [DAMAGE]},
        },
        "grid": {"adaptation": {"window": list(range(1, members + 1))}},
    }


def text(members: int, *, trials: int, replicates: int) -> str:
    """The same as a campaign file."""
    made = content(members, trials=trials, replicates=replicates)
    return tomli_w.dumps({"name": "tiny", **made})


def held(directory: Path, without: Container[str] = ("log.jsonl",)) -> dict[str, bytes]:
    """Bytes of all files by path, without what tells of wall times.

    Args:
        directory: of a store or a run.
        without: names of files that are left out.
    """
    return {
        str(path.relative_to(directory)): path.read_bytes()
        for path in sorted(directory.rglob("*"))
        if path.is_file() and path.name not in without
    }


def rows_of(path: Path) -> list[dict]:
    """The rows that a bench has kept so far, a line of JSON each."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def drives(path: Path) -> None:
    """Write four drives of the Khepera III as a dataset."""
    import numpy as np

    from bns.worlds import registry
    from bns.worlds.data import dataset
    from bns.worlds.trial import Commands

    world = registry.make("mujoco", robot="khepera3", threads=1)
    told = [Commands(np.full((2, 2), 0.1), [0.4, 0.3 + 0.1 * k]) for k in range(4)]
    dataset.write(path, world.run(told))
