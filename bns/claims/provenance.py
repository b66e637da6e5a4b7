"""From what a finding was made, and whether that is what there is today.

A configuration is known by the digest of all its settings, defaults included, under
their names in a file: dotted keys, sorted, and their values. Replicates, seeds, threads
and the sections that an investigation names as `ignored` (those of other learners) are
no part of it. Beside each finding the settings themselves are kept, so that what does
not match says where. Of the runs that a store holds of the sides of claims, those that
are of today's settings and code are read.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from bns.campaign.identity import NO_PART, digest
from bns.campaign.store import CampaignStore
from bns.claims import measures
from bns.experiment.config import RunConfig
from bns.experiment.loading import flat, to_mapping
from bns.experiment.versions import REVISION

LENGTH = 16  # hexadecimal digits of a digest

Settings = Mapping[str, Any]


@dataclass(frozen=True)
class Made:
    """From what a finding was made.

    Attributes:
        sides: digest of each side's settings.
        revision: `bns.experiment.versions.REVISION` of the code that ran it.
        commits: of the code, all there were.
        dates: first and last day on which its runs ended, ISO.
        seeds: of the batches.
        versions: of the packages.
        seconds: that the batches took which its runs are part of.
    """

    sides: tuple[str, ...]
    revision: int
    commits: tuple[str, ...] = ()
    dates: tuple[str, ...] = ()
    seeds: tuple[int, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    seconds: float = 0.0


def resolved(config: RunConfig, ignored: Collection[str] = ()) -> dict[str, Any]:
    """All settings that are part of what a configuration is, by dotted key, sorted.

    Args:
        config: the configuration.
        ignored: sections that are no part of it.
    """
    flattened = flat(
        {
            key: value
            for key, value in to_mapping(config).items()
            if key not in ignored and key not in NO_PART
        }
    )
    return dict(sorted(flattened.items()))


def of(settings: Settings) -> str:
    """The digest of settings."""
    return digest(dict(settings), LENGTH)


def difference(now: Settings, then: Settings) -> str:
    """Where settings differ, in words; empty where they do not."""
    for key in sorted({*now, *then}):
        if key not in then:
            return f"{key} = {now[key]!r} is new"
        if key not in now:
            return f"{key} = {then[key]!r} is gone"
        if now[key] != then[key]:
            return f"{key} was {then[key]!r}, is {now[key]!r}"
    return ""


def current(made: Made, sides: tuple[str, ...]) -> bool:
    """Whether what was made from this is what would be made today.

    Args:
        made: from what it was made.
        sides: digests of the sides as they are today.
    """
    return made.sides == sides and made.revision == REVISION


@dataclass(frozen=True, eq=False)
class Batch:
    """Consecutive runs of one configuration, and where they come from.

    Attributes:
        start: number of the first run.
        count: how many runs.
        facts: seed, commit and versions, as the batch itself says.
        date: day on which it ended, ISO.
        seconds: that it took.
        values: name of a measure -> its value in every run, ``(count,)``; NaN = none.
    """

    start: int
    count: int
    facts: Mapping[str, Any]
    date: str
    seconds: float
    values: Callable[[str], np.ndarray]


@dataclass(frozen=True, eq=False)
class Held:
    """Runs of one configuration, the first ones without a gap.

    Attributes:
        digest: of its settings.
        batches: in the order of runs.
    """

    digest: str
    batches: tuple[Batch, ...]

    @property
    def runs(self) -> int:
        """How many there are."""
        return sum(batch.count for batch in self.batches)

    def values(self, measure: str) -> np.ndarray:
        """A measure of every run, ``(R,)``; NaN where a run has no value."""
        return np.concatenate([batch.values(measure) for batch in self.batches])


def read(
    directory: Path,
    wanted: Mapping[str, tuple[str, Sequence[str]]],
    kept: Mapping[str, Sequence[Batch]] = MappingProxyType({}),
) -> dict[str, Held]:
    """The runs in a store of configurations as they are today.

    Args:
        directory: of the store; one that is not there holds none.
        wanted: identity -> digest of its settings today, and the sections that are no
            part of it. Runs of other settings, or of code of another revision, are
            not there.
        kept: digest of settings -> batches that lie elsewhere and count as well.

    Returns:
        identity -> `Held`.

    Raises:
        FormatError: the store is damaged or of a newer version.
    """
    found: dict[str, list[Batch]] = {}
    if (directory / "campaign.json").exists():
        found = _stored(CampaignStore.open(directory), wanted)
    for identity, (settings, _) in wanted.items():
        if settings in kept:
            found.setdefault(identity, []).extend(kept[settings])
    return {
        identity: Held(wanted[identity][0], first)
        for identity, batches in found.items()
        if (first := _without_gap(batches))
    }


def _stored(
    store: CampaignStore, wanted: Mapping[str, tuple[str, Sequence[str]]]
) -> dict[str, list[Batch]]:
    log = {entry["batch"]: entry for entry in store.log() if "batch" in entry}
    found: dict[str, list[Batch]] = {}
    for part in store.read():
        if part.facts.get("revision", 0) != REVISION:
            continue
        entry = log.get(part.key, {})
        share = float(entry.get("computed", 0.0)) / len(part.blocks)
        for block in part.blocks:
            if block.identity not in wanted:
                continue
            digest, ignored = wanted[block.identity]
            if of(resolved(block.config, ignored)) == digest:
                values = partial(measures.of, block.record())
                batch = Batch(
                    block.start, block.count, part.facts, _date(entry), share, values
                )
                found.setdefault(block.identity, []).append(batch)
    return found


def made(sides: Sequence[Held], runs: int) -> Made:
    """From what the first `runs` runs of each side were made."""
    used = [batch for side in sides for batch in side.batches if batch.start < runs]
    each = {id(batch): batch for batch in used}.values()
    dates = sorted(batch.date for batch in each if batch.date)
    versions: dict[str, str] = {}
    for batch in each:
        versions |= batch.facts.get("versions", {})
    return Made(
        sides=tuple(side.digest for side in sides),
        revision=REVISION,
        commits=tuple(sorted({b.facts.get("commit", "unknown") for b in each})),
        dates=tuple(dict.fromkeys((dates[0], dates[-1]))) if dates else (),
        seeds=tuple(dict.fromkeys(int(b.facts["seed"]) for b in each)),
        versions=versions,
        seconds=round(sum(batch.seconds for batch in each), 1),
    )


def _without_gap(batches: list[Batch]) -> tuple[Batch, ...]:
    first: list[Batch] = []
    for batch in sorted(batches, key=lambda item: item.start):
        if batch.start == sum(each.count for each in first):
            first.append(batch)
    return tuple(first)


def _date(entry: Mapping[str, Any]) -> str:
    if "at" not in entry:
        return ""
    return datetime.fromtimestamp(entry["at"], UTC).date().isoformat()
