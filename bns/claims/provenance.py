"""From what a finding was made, and whether that is what there is today.

A configuration is known by the digest of all its settings, defaults included, under
their names in a file: dotted keys, sorted, and their values. Replicates, seeds, threads
and the sections that an investigation names as `ignored` (those of other learners) are
no part of it. Beside each finding the settings themselves are kept, so that what does
not match says where.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from bns.campaign.identity import NO_PART, digest
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
