"""Finished run directories taken into a campaign's store: nothing runs twice."""

from collections.abc import Container
from dataclasses import replace
from pathlib import Path

from bns.campaign.identity import digest, identity
from bns.campaign.part import Block, Part, encode
from bns.campaign.store import CampaignStore
from bns.campaign.work import packages
from bns.errors import FormatError


def adopt(
    store: CampaignStore, folder: Path, wanted: Container[str], held: Container[str]
) -> list[str]:
    """Take the finished runs below a folder whose configurations are wanted.

    Args:
        store: locked by the caller.
        folder: holds run directories.
        wanted: identities to take.
        held: identities of which the store has runs already; they are left alone.

    Returns:
        Names of the directories taken.

    Raises:
        FormatError: no such folder.
    """
    from bns.storage.store import RunStore

    if not folder.is_dir():
        raise FormatError(f"There is no folder {folder} to take runs from.")
    taken = []
    seen: set[str] = set()
    for path in sorted(folder.glob("*/run.json")):
        run = RunStore.open(path.parent)
        name = identity(run.config)
        if not run.finished or name not in wanted or name in held or name in seen:
            continue
        record = run.record()
        config = replace(run.config, preset="", record_replicates=0, threads=1)
        onset = int(record.damage_onset[0])
        columns = {key: values for key, values in record.columns.items()}
        block = Block(name, config, 0, onset, columns)
        key = digest(["run", name, config.seed, config.replicates], 16)
        made = {name: run.versions.get(name, "") for name in packages()}
        facts = {"seed": config.seed, "world_seed": config.seed, "mode": run.mode}
        facts["commit"] = run.versions.get("commit", "unknown")
        facts["revision"] = int(run.versions.get("revision", 0))
        store.add(key, encode(Part(key, (block,), facts | {"versions": made})))
        store.note(adopted=key, seed=config.seed)
        seen.add(name)
        taken.append(path.parent.name)
    return taken
