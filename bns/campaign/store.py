"""The directory of a campaign: a file per batch, compacted to one, readable meanwhile.

    campaign.json     format, schema, name, seed, versions of the packages
    campaign.toml     the campaign file as it was given last
    parts/KEY.parquet a batch that is done and not yet compacted
    failed/KEY.json   a batch that failed, and why
    results.parquet   all batches together, made when a session ends
    log.jsonl         sessions and wall times

Every file is written beside its place and renamed, so it is whole or absent; it carries
checksums. A batch counts as done when its part is there. `results.parquet` is replaced
before the parts in it are removed; a batch found in both counts once. Batches stand in
it in the order of their keys, so that an undisturbed and a disturbed campaign end with
the same bytes in everything but `log.jsonl`.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import msgspec

from bns.campaign.identity import digest, identity
from bns.campaign.part import (
    RESULTS_FORMAT,
    RESULTS_SCHEMA,
    Block,
    Compact,
    Part,
    decode,
    encode,
    write_results,
)
from bns.campaign.work import packages
from bns.errors import BnsError, FormatError
from bns.storage import files, reading, seal
from bns.storage.lock import Lock
from bns.storage.store import read_head

HEAD, FILE = "campaign.json", "campaign.toml"


class Head(msgspec.Struct):
    """What campaign.json says, beside its format and schema."""

    name: str
    seed: int
    versions: dict[str, str]


class Failure(msgspec.Struct):
    """What failed/KEY.json says."""

    key: str
    reason: str
    attempts: Annotated[int, msgspec.Meta(ge=0, le=1_000_000)]


@dataclass(eq=False)
class CampaignStore:
    """A campaign's directory.

    Attributes:
        directory: where.
        name: of the campaign.
        seed: of the campaign.
        versions: packages that made it.
        lock: held while it is written.
    """

    directory: Path
    name: str
    seed: int
    versions: Mapping[str, str]
    lock: Lock | None = field(default=None, repr=False)

    @classmethod
    def create(
        cls, directory: Path, name: str, seed: int, lock: Lock | None = None
    ) -> "CampaignStore":
        """A new directory.

        Args:
            directory: where; locked by who calls.
            name: of the campaign.
            seed: of the campaign.
            lock: of the directory.

        Raises:
            BnsError: there is something in it, or it cannot be written.
        """
        if directory.exists() and not directory.is_dir():
            raise BnsError(f"{directory} is a file: give another --out.")
        if (directory / HEAD).exists():
            raise BnsError(
                f"{directory} holds a campaign already: add --resume to go on with it, "
                "or give another --out."
            )
        if directory.exists():
            held = [p.name for p in directory.iterdir() if p.name != FILE]
            held = [name for name in held if not name.startswith(files.TEMPORARY)]
            if held:
                raise BnsError(
                    f"{directory} is not empty and holds no campaign ({min(held)}): "
                    "give another --out. Nothing was changed."
                )
        store = cls(directory, name, seed, packages(), lock)
        files.make_directory(directory)
        files.write_json(
            directory / HEAD,
            {
                "format": RESULTS_FORMAT,
                "schema": RESULTS_SCHEMA,
                "name": name,
                "seed": seed,
                "versions": dict(store.versions),
            },
        )
        return store

    @classmethod
    def open(cls, directory: Path | str) -> "CampaignStore":
        """An existing directory; nothing in it is changed.

        Raises:
            FormatError: none, damaged, or written by a newer version.
        """
        directory = Path(directory)
        path = directory / HEAD
        head = read_head(
            path, kind="campaign", format=RESULTS_FORMAT, schema=RESULTS_SCHEMA
        )
        said = reading.typed(head, Head, path)
        return cls(directory, said.name, said.seed, said.versions)

    def check_versions(self) -> None:
        """Refuse to add results that other versions would make.

        Raises:
            BnsError: which package differs.
        """
        for name, here in packages().items():
            there = self.versions.get(name, "none")
            if there != here:
                raise BnsError(
                    f"{self.directory} was made with {name} {there}, here is {here}: "
                    f"install {name}=={there}, give another --out, or add --mix to "
                    "put results of both into one store."
                )

    def tidy(self) -> None:
        """Remove what a killed writer left half-written."""
        for folder in (self.directory, self.parts, self.failed):
            files.remove_temporary(folder)

    def close(self) -> None:
        """Let others write here."""
        if self.lock is not None:
            self.lock.release()

    @property
    def parts(self) -> Path:
        """Where batches are before they are compacted."""
        return self.directory / "parts"

    @property
    def failed(self) -> Path:
        """Where failures are."""
        return self.directory / "failed"

    def add(self, key: str, data: bytes) -> None:
        """Store a batch; it was not done before and is done after.

        Raises:
            StorageError: no space, or no permission.
        """
        files.make_directory(self.parts)
        files.write_bytes(self.parts / f"{key}.parquet", data)
        (self.failed / f"{key}.json").unlink(missing_ok=True)

    def fail(self, key: str, **entry: Any) -> None:
        """Store that a batch failed, and why."""
        files.make_directory(self.failed)
        files.write_json(self.failed / f"{key}.json", {"key": key, **entry})

    def failures(self) -> dict[str, dict[str, Any]]:
        """Batches that failed, by key."""
        paths = sorted(self.failed.glob("[0-9a-f]*.json"))
        said = {path: seal.opened(reading.read_json(path), path) for path in paths}
        return {
            path.stem: msgspec.structs.asdict(reading.typed(entry, Failure, path))
            for path, entry in said.items()
        }

    def forgive(self) -> None:
        """Forget all failures, so that they are tried again."""
        files.remove_tree(self.failed)

    def read(self) -> Iterator[Part]:
        """Every batch that is done, in the order of keys; each once.

        Batches may be added, and compacted, meanwhile.

        Raises:
            FormatError: a file that is damaged or of a newer version.
        """
        loose = {path.stem: path for path in self.parts.glob("[0-9a-z]*.parquet")}
        compact = Compact(self.directory)
        for key in sorted({*loose, *compact.parts}):
            if key in compact.parts:
                yield compact.read(key)
                continue
            try:
                data = reading.read_bytes(loose[key], most=reading.DATA)
            except FormatError:
                compact = Compact(self.directory)
                if key not in compact.parts:  # compacted since, if it is there
                    raise
                yield compact.read(key)
            else:
                yield decode(data, str(loose[key]))

    def compact(self) -> None:
        """Bring all batches into results.parquet."""
        loose = sorted(self.parts.glob("[0-9a-z]*.parquet"))
        if loose:
            write_results(self.directory, list(self.read()))
            for path in loose:
                path.unlink()
        files.remove_tree(self.parts)

    def note(self, **entry: Any) -> None:
        """Append a line to log.jsonl."""
        files.append_entry(self.directory / "log.jsonl", **entry)

    def log(self) -> list[dict[str, Any]]:
        """The lines of log.jsonl; a torn last line is left out."""
        return files.read_entries(self.directory / "log.jsonl")


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
