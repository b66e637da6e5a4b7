"""Campaigns that benches share: small batches of real runs."""

from collections.abc import Mapping
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


def held(directory: Path) -> Mapping[str, bytes]:
    """Bytes of a store, without what tells of wall times."""
    return {
        str(path.relative_to(directory)): path.read_bytes()
        for path in sorted(directory.rglob("*"))
        if path.is_file() and path.name != "log.jsonl"
    }
