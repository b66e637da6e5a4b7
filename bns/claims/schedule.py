"""Which batches claims need next, and what they cost.

A trial of a run costs what its world and training take, and what evolution takes, which
grows with individuals, generations and hidden neurons; `data/price.toml` has what was
measured (`python -m bench claims-price`). How many runs a comparison takes is expected
from its share: as found before, even if that finding is stale; else as the
dissertation's p implies for thirty runs a side; else 0.75. Trials that sides share are
counted once.

The runs of a side come in blocks that end at the looks: 1 to 10, 11 to 20, and so on.
A block of one side is a batch of its own, on one core, with a seed from what the side
is until its damage: sides that share those trials have the same seed, and their trunk
is trained once. So a side's runs depend on nothing but itself, whatever else is run,
and in whatever order.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special
from scipy import stats as scipy_stats

from bns.campaign import trunk
from bns.campaign.file import Member
from bns.campaign.identity import batch_seed, digest, identity, world_seed
from bns.campaign.plan import Job
from bns.claims import published, report, verdict
from bns.claims.claim import Cell, Claim, lacking, member_of
from bns.claims.published import Stale
from bns.claims.report import Judged
from bns.claims.verdict import Finding
from bns.experiment import versions
from bns.experiment.config import RunConfig
from bns.stats.designs import LOOKS, of_share
from bns.stats.measures import a12_error
from bns.tasks import registry as tasks

FILE = "price.toml"
UNKNOWN = 0.75  # share expected where nothing is known
RUNS_THERE = 30  # a side in the dissertation


@dataclass(frozen=True)
class Price:
    """Processor time.

    Attributes:
        sides: that have runs.
        runs: of all of them.
        hours: planned, one core each.
        apart: the same without sharing trials before the damage.
    """

    sides: int
    runs: int
    hours: float
    apart: float


@cache
def rates() -> Mapping[str, Mapping[str, float]]:
    """What was measured, by kind of task [s of a processor]."""
    path = files("bns.claims.data") / FILE
    return tomllib.loads(path.read_text(encoding="utf-8"))


def seconds(config: RunConfig, first: int, last: int) -> float:
    """Processor time of a run's trials from `first` up to `last` [s]."""
    rate = rates()[tasks.kind(config.task.name)]
    size = config.snn.hidden / rate["hidden"]
    work = config.evolution.population * config.evolution.generations * size
    each = rate["trial"] * size + rate["evolution"] * work
    numbers = np.arange(first, last)
    patterns = rate["patterns"] * numbers
    if config.adaptation.window:
        patterns = np.minimum(patterns, config.adaptation.window)
    return float(each * len(numbers) + rate["pattern"] * patterns.sum())


def expected(cell: Cell, share: float | None) -> int:
    """Runs a side that a comparison takes if its share is as it is expected.

    Args:
        cell: the comparison.
        share: expected; None = nothing is known of it.
    """
    design = verdict.design(cell)
    share = UNKNOWN if share is None else share
    if cell.says == "<" and share == UNKNOWN:
        share = 1 - UNKNOWN
    found: list[float] = []
    for runs in design.looks:
        alike = 1.0
        if cell.b:
            z = abs(share - 0.5) / a12_error(0.5, runs, runs)
            found.append(float(2 * special.ndtr(-z)))
            if runs >= verdict.ALIKE_FROM:
                alike = of_share(share, runs, runs)
        else:
            test = scipy_stats.binomtest(round(share * runs), runs, 0.5)
            found.append(float(test.pvalue))
        says = cell.says if cell.b else ">"
        if verdict.stops(says, share, design.p(found), alike):
            return runs
    return design.looks[-1]


def implied(cell: Cell) -> float | None:
    """The share that the dissertation's p implies; None where it prints none."""
    if not cell.b or cell.p in ("-", "n.s."):
        return 0.5 if cell.says == "=" else None
    p = float(re.sub(r"[<>=]", "", cell.p))
    error = a12_error(0.5, RUNS_THERE, RUNS_THERE)
    apart = min(0.5, float(-special.ndtri(max(p, 5e-6) / 2)) * error)
    return 0.5 - apart if cell.says == "<" else 0.5 + apart


def planned(claims: Iterable[Claim], *, world: str) -> Price:
    """What claims would cost if none of them had run.

    Args:
        claims: to be tested.
        world: where.
    """
    wanted: dict[str, tuple[Member, int]] = {}
    for claim in claims:
        for cell in claim.cells:
            before = published.finding(claim, cell, world=world)
            runs = expected(cell, _share(before, cell))
            _want(wanted, claim, cell, world, runs)
    return _price(wanted, {})


def left(rows: Iterable[Judged], *, world: str) -> str:
    """What claims still cost, in a line."""
    wanted: dict[str, tuple[Member, int]] = {}
    done: dict[str, int] = {}
    for row in rows:
        found = {each.cell: each for each in row.findings}
        for cell in row.claim.cells:
            here = found.get(cell)
            runs = min(here.runs) if here else 0
            if here is None or not here.stopped:
                before = here or published.finding(row.claim, cell, world=world)
                more = expected(cell, _share(before, cell))
                looks = [n for n in verdict.design(cell).looks if n > runs]
                _want(wanted, row.claim, cell, world, max(more, looks[0]))
            _want(done, row.claim, cell, world, runs, counts=True)
    price = _price(wanted, done)
    return (
        f"claims in {world}: {price.runs} runs of {price.sides} sides to come, about "
        f"{price.hours:.1f} processor hours"
    )


def _share(before: Finding | Stale | None, cell: Cell) -> float | None:
    if isinstance(before, Finding):
        return before.share.value
    return before.share if isinstance(before, Stale) else implied(cell)


def _want(
    found: dict[str, Any],
    claim: Claim,
    cell: Cell,
    world: str,
    runs: int,
    *,
    counts: bool = False,
) -> None:
    """Note the runs that the sides of a comparison need, or have."""
    letter = claim.investigation
    if lacking(letter, cell, world=world):
        return
    for side in cell.sides:
        member = member_of(letter, side, world=world)
        name = member.identity
        if counts:
            found[name] = max(runs, found.get(name, 0))
        else:
            found[name] = (member, max(runs, found.get(name, (member, 0))[1]))


def _price(wanted: Mapping[str, tuple[Member, int]], done: Mapping[str, int]) -> Price:
    total = apart = 0.0
    count = 0
    trunks: dict[str, tuple[float, int]] = {}
    due = {
        name: (member, runs - done.get(name, 0))
        for name, (member, runs) in wanted.items()
        if runs > done.get(name, 0)
    }
    for member, runs in due.values():
        config = member.config
        length = trunk.shared(config)
        total += runs * seconds(config, length, config.trials)
        apart += runs * seconds(config, 0, config.trials)
        count += runs
        if length:
            bare = trunk.bare(config)
            name = identity(bare)
            _, most = trunks.get(name, (0.0, 0))
            trunks[name] = (seconds(bare, 0, length), max(most, runs))
    total += sum(each * runs for each, runs in trunks.values())
    return Price(len(due), count, total / 3600, apart / 3600)


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
            if later and not lacking(letter, cell, world=world):
                members = tuple(
                    member_of(letter, side, world=world, quick=quick)
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
