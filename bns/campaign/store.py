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

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import msgspec

from bns.campaign.compact import FORMAT, SCHEMA, Compact, write
from bns.campaign.part import Part, decode
from bns.campaign.work import packages
from bns.errors import BnsError, FormatError
from bns.storage import files, journal, reading, seal
from bns.storage.directory import read_head
from bns.storage.lock import Lock

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
                "format": FORMAT,
                "schema": SCHEMA,
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
        head = read_head(path, kind="campaign", format=FORMAT, schema=SCHEMA)
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
            write(self.directory, list(self.read()))
            for path in loose:
                path.unlink()
        files.remove_tree(self.parts)

    def note(self, **entry: Any) -> None:
        """Append a line to log.jsonl."""
        journal.note(self.directory / "log.jsonl", **entry)

    def log(self) -> list[dict[str, Any]]:
        """The lines of log.jsonl; a torn last line is left out."""
        return journal.entries(self.directory / "log.jsonl")
