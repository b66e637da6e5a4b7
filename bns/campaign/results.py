"""What a store holds, by member: all replicates together, ready to be compared."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bns.campaign.file import Campaign, Member, from_content
from bns.campaign.part import Block
from bns.campaign.store import FILE, CampaignStore
from bns.errors import FormatError
from bns.experiment.record import RunRecord
from bns.storage import reading, seal


@dataclass(frozen=True, eq=False)
class Results:
    """A campaign and what is stored of it.

    Attributes:
        campaign: what was wanted.
        store: where it is.
        records: identity -> all replicates stored, for members that have any.
    """

    campaign: Campaign
    store: CampaignStore
    records: Mapping[str, RunRecord]

    def of(self, member: Member) -> RunRecord | None:
        """The runs of a member, if there are any."""
        return self.records.get(member.identity)


def read(directory: Path | str) -> Results:
    """A campaign's directory, finished or not.

    Raises:
        FormatError: not such a directory, damaged, or of a newer version.
    """
    store = CampaignStore.open(directory)
    campaign = wanted(store)
    known = {member.identity for member in campaign.members}
    return Results(campaign, store, records(store, known))


def wanted(store: CampaignStore) -> Campaign:
    """The campaign whose file lies in the store.

    Raises:
        FormatError: it is not there.
    """
    path = store.directory / FILE
    if not path.exists():
        raise FormatError(
            f"{path} is missing, so nothing says what was wanted: run `bns campaign "
            f"run FILE.toml --out {store.directory} --resume`."
        )
    text = seal.opened_text(reading.read_text(path), path)
    return from_content(reading.toml(text, path), store.name, sure=True)


def records(store: CampaignStore, known: set[str]) -> dict[str, RunRecord]:
    """Identity -> all stored replicates of the configurations in `known`."""
    blocks: dict[str, dict[int, Block]] = {}
    for part in store.read():
        for block in part.blocks:
            if block.identity in known:
                blocks.setdefault(block.identity, {}).setdefault(block.start, block)
    return {
        identity: joined([found[start] for start in sorted(found)])
        for identity, found in blocks.items()
    }


def joined(blocks: list[Block]) -> RunRecord:
    """Blocks of one configuration as one record."""
    names = set.intersection(*(set(block.columns) for block in blocks))
    columns = {
        name: np.concatenate([block.columns[name] for block in blocks])
        for name in blocks[0].columns
        if name in names
    }
    first = blocks[0]
    runs = sum(block.count for block in blocks)
    config = replace(first.config, replicates=runs)
    return Block(first.identity, config, 0, first.onset, columns).record()


def status(found: Results) -> dict[str, Any]:
    """How far the campaign is: runs by member, batches that failed."""
    rows: list[dict[str, Any]] = [
        {
            "member": member.label,
            "identity": member.identity,
            "runs": record.replicates if (record := found.of(member)) else 0,
            "wanted": found.campaign.replicates,
        }
        for member in found.campaign.members
    ]
    done = sum(min(row["runs"], row["wanted"]) for row in rows)
    return {
        "name": found.campaign.name,
        "runs": done,
        "wanted": found.campaign.runs,
        "members": rows,
        "failed": list(found.store.failures().values()),
    }
