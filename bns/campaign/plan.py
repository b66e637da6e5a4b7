"""What a campaign has still to run, grouped into batches.

Members that differ in adaptation and world only can share a batch. They are joined,
in the order of their identities, until a batch holds `batch_runs` runs; a member with
more replicates than that is split into several. So the plan, and with it every seed,
follows from what is to be run, not from the order in which it was written down. A
member alone in its batch has seeds that depend on nothing but itself.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

from bns.campaign.file import Campaign, Member
from bns.campaign.identity import batch_seed, core, digest, world_seed
from bns.experiment import versions
from bns.experiment.config import RunConfig
from bns.experiment.loading import from_mapping, to_mapping


@dataclass(frozen=True)
class Job:
    """A batch to be run.

    Attributes:
        key: its name, from who is in it.
        seed: of the learner.
        world_seed: of worlds that are trained.
        start: number of the first replicate.
        configs: identity -> configuration, in the order of the runs.
        trunk: file of the trials that its one configuration shares with others (see
            `bns.campaign.trunk`); empty = none.
        grows: whether it makes that file, and nothing else.
        commit: of the code, as whoever planned it has it.
    """

    key: str
    seed: int
    world_seed: int
    start: int
    configs: Mapping[str, RunConfig]
    trunk: str = ""
    grows: bool = False
    commit: str = ""

    @property
    def count(self) -> int:
        """Replicates of each configuration."""
        return next(iter(self.configs.values())).replicates

    @property
    def work(self) -> int:
        """Trials of all its runs together."""
        return sum(c.trials * c.replicates for c in self.configs.values())

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {
            "key": self.key,
            "seed": self.seed,
            "world_seed": self.world_seed,
            "start": self.start,
            "configs": {i: to_mapping(c) for i, c in self.configs.items()},
            "trunk": self.trunk,
            "grows": self.grows,
            "commit": self.commit,
        }

    @classmethod
    def from_mapping(cls, content: Mapping[str, Any]) -> "Job":
        """The job that `to_mapping` gave."""
        configs = {i: from_mapping(c) for i, c in content["configs"].items()}
        return cls(**{**content, "configs": configs})


def plan(campaign: Campaign, done: Mapping[str, int]) -> list[Job]:
    """The batches that are missing, in an order that does not depend on the file's.

    Args:
        campaign: what is wanted.
        done: identity -> replicates that are stored.
    """
    blocks = [
        (core(member.config), start, count, member)
        for member in campaign.members
        for start, count in _blocks(campaign, done.get(member.identity, 0))
    ]
    blocks.sort(key=lambda block: (*block[:3], block[3].identity))
    jobs, code = [], versions.commit()
    for (_, start, count), group in groupby(blocks, key=lambda block: block[:3]):
        members = [block[3] for block in group]
        together = max(1, campaign.batch_runs // count)
        for first in range(0, len(members), together):
            part = members[first : first + together]
            jobs.append(replace(_job(campaign.seed, part, start, count), commit=code))
    return sorted(jobs, key=lambda job: job.key)


def _blocks(campaign: Campaign, done: int) -> Iterable[tuple[int, int]]:
    for start in range(done, campaign.replicates, campaign.batch_runs):
        yield start, min(campaign.batch_runs, campaign.replicates - start)


def _job(seed: int, members: Sequence[Member], start: int, count: int) -> Job:
    names = [(member.identity, start) for member in members]
    of_batch = batch_seed(seed, names)
    configs = {
        member.identity: replace(
            member.config,
            preset="",
            seed=of_batch,
            replicates=count,
            record_replicates=0,
            threads=1,
        )
        for member in members
    }
    key = digest([names, count, seed], 16)
    return Job(key, of_batch, world_seed(seed), start, configs)
