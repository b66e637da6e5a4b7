"""Runs taken into a store: of other stores, and of finished run directories."""

from collections.abc import Container, Sequence
from dataclasses import replace
from pathlib import Path

from bns.campaign.identity import digest, identity
from bns.campaign.part import Block, Part, encode
from bns.campaign.store import CampaignStore
from bns.campaign.work import packages
from bns.errors import BnsError, FormatError
from bns.storage.lock import Lock


def merge(out: Path, others: Sequence[Path], *, mix: bool = False) -> int:
    """Take what a campaign's directory lacks from others; gives the number of runs.

    A run is known by its configuration, the campaign's seed and its number, wherever it
    ran; one that is held already is left alone. What a batch has of a configuration is
    taken as a whole, or not at all where some of its runs are held. The others are not
    changed.

    Args:
        out: a campaign's directory.
        others: directories of campaigns of the same seed.
        mix: take results of other package versions as well.

    Raises:
        BnsError: a campaign of another seed or version, one that is being written.
        FormatError: a directory that holds no campaign, or a damaged file.
    """
    CampaignStore.open(out)  # there is one
    with Lock(out, make=False):
        store = CampaignStore.open(out)
        sources = [CampaignStore.open(other) for other in others]
        for source in sources:
            _check(store, source, mix)
        store.tidy()
        held = {run for part in store.read() for b in part.blocks for run in _runs(b)}
        begun = len(held)
        for source in sources:
            for part in source.read():
                blocks = tuple(b for b in part.blocks if held.isdisjoint(_runs(b)))
                if blocks:
                    store.add(part.key, encode(replace(part, blocks=blocks)))
                    held.update(run for block in blocks for run in _runs(block))
        store.note(event="merge", runs=len(held) - begun)
        store.compact()
    return len(held) - begun


def _runs(block: Block) -> set[tuple[str, int]]:
    return {(block.identity, block.start + i) for i in range(block.count)}


def _check(store: CampaignStore, other: CampaignStore, mix: bool) -> None:
    if other.directory.resolve() == store.directory.resolve():
        raise BnsError(f"{other.directory} is given twice: name the others once each.")
    if other.seed != store.seed:
        raise BnsError(
            f"{other.directory} was made with seed = {other.seed}, {store.directory} "
            f"with {store.seed}: a run of one is not that of the other."
        )
    unlike = {*other.versions.items()} ^ {*store.versions.items()}
    differing = ", ".join(sorted({name for name, _ in unlike}))
    if differing and not mix:
        raise BnsError(
            f"{other.directory} was made with another {differing} than "
            f"{store.directory}: add --mix to put results of both into one store."
        )


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
