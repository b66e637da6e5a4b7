"""Which batches claims need next.

The runs of a side come in blocks that end at the looks: 1 to 10, 11 to 20, and so on.
A block of one side is a batch of its own, on one core, with a seed from what the side
is until its damage: sides that share those trials have the same seed, and their trunk
is trained once. So a side's runs depend on nothing but itself, whatever else is run,
and in whatever order.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bns.campaign import trunk
from bns.campaign.file import Member
from bns.campaign.identity import batch_seed, digest, identity, world_seed
from bns.campaign.plan import Job
from bns.claims import report, sides
from bns.claims.claim import Cell
from bns.claims.report import Judged
from bns.experiment import versions
from bns.stats.designs import LOOKS

MOST = 50  # runs of a batch
SEED = 0
TRUNKS = "trunks"


@dataclass(frozen=True)
class Due:
    """Runs that a comparison needs next.

    Attributes:
        cell: the comparison.
        members: its sides.
        runs: on each side, at its next look.
    """

    cell: Cell
    members: tuple[Member, ...]
    runs: int


def due(
    rows: Iterable[Judged], *, world: str, quick: bool = False, runs: int = 0
) -> list[Due]:
    """What comparisons need next that have not stopped.

    Args:
        rows: claims, judged.
        world: where they run.
        quick: small and short versions: one look, at `runs`.
        runs: the last look at most; 0 = as designed.
    """
    found = []
    for row in rows:
        stopped = {each.cell for each in row.findings if each.stopped}
        seen = {each.cell: min(each.runs) for each in row.findings}
        for cell in row.claim.cells:
            if cell in stopped:
                continue
            looks = (runs,) if quick else report.looks(cell, runs).looks
            later = [look for look in looks if look > seen.get(cell, 0)]
            letter = row.claim.investigation
            if later and not sides.missing(letter, cell, world=world):
                members = tuple(
                    sides.member(letter, side, world=world, quick=quick)
                    for side in cell.sides
                )
                found.append(Due(cell, members, later[0]))
    return found


def blocks(runs: int, done: int = 0) -> list[tuple[int, int]]:
    """First run and count of each block up to so many runs, from those done on."""
    ends = [*range(MOST, runs, MOST), *(look for look in LOOKS if look < runs), runs]
    found, start = [], done
    for end in sorted(set(ends)):
        if end > start:
            found.append((start, end - start))
            start = end
    return found


def jobs(wanted: Sequence[Due], done: Mapping[str, int], store: Path) -> list[Job]:
    """The batches of what is due, trunks first, dearest sides first.

    Args:
        wanted: what is due.
        done: identity -> runs that are there.
        store: where trunks are kept.
    """
    runs: dict[str, int] = {}
    members: dict[str, Member] = {}
    for each in wanted:
        for member in each.members:
            name = member.identity
            members[name] = member
            runs[name] = max(runs.get(name, 0), each.runs)
    code = versions.commit()
    made = [
        replace(job(members[name], start, count, store), commit=code)
        for name in sorted(members)
        for start, count in blocks(runs[name], done.get(name, 0))
    ]
    return [
        *trunks(made),
        *sorted(made, key=lambda job: (-job.work, job.key)),
    ]


def trunks(made: Sequence[Job]) -> list[Job]:
    """The batches that make trunks which several of some batches share, by key."""
    shared: dict[str, Job] = {}
    for batch in made:
        if batch.trunk and not Path(batch.trunk).exists():
            shared.setdefault(batch.trunk, batch)
    many = {path: sum(other.trunk == path for other in made) for path in shared}
    growing = [
        replace(each, key=f"{Path(path).stem}", grows=True)
        for path, each in shared.items()
        if many[path] > 1
    ]
    return sorted(growing, key=lambda job: job.key)


def job(member: Member, start: int, count: int, store: Path) -> Job:
    """The batch of a block of runs of a side.

    Args:
        member: the side.
        start: first replicate of the block.
        count: replicates of the block.
        store: directory in which the trunks are kept, too.
    """
    config, name = member.config, member.identity
    length = trunk.shared(config)
    root = identity(trunk.bare(config)) if length else name
    seed = batch_seed(SEED, [(root, start)])
    config = replace(
        config, preset="", seed=seed, replicates=count, record_replicates=0, threads=1
    )
    path = store / TRUNKS / f"{digest([root, length, start, count, SEED], 16)}.npz"
    return Job(
        key=digest([name, start, count, SEED, "claims"], 16),
        seed=seed,
        world_seed=world_seed(SEED),
        start=start,
        configs={name: config},
        trunk=str(path) if length else "",
    )
