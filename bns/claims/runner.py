"""Run what claims need and is missing, in a store of its own for each world."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from bns.campaign import drive
from bns.campaign.adopt import adopt
from bns.campaign.engines.base import Engine
from bns.campaign.file import Campaign, Member
from bns.claims import sides, verdict
from bns.claims.claim import Claim
from bns.storage.lock import Lock

ROOT = Path("runs/claims")
QUICK_RUNS = 6
SEED = 0


@dataclass(frozen=True)
class Need:
    """Members that claims need, and how many runs of each.

    Attributes:
        members: each once.
        runs: identity -> runs wanted.
        impossible: claim -> why none of it can run.
    """

    members: tuple[Member, ...]
    runs: dict[str, int]
    impossible: dict[str, str]


def directory(world: str, *, quick: bool, root: Path = ROOT) -> Path:
    """Where the runs for claims in a world are kept."""
    return root / (f"{world}-quick" if quick else world)


def needed(
    claims: Iterable[Claim], *, world: str, quick: bool = False, runs: int = 0
) -> Need:
    """What claims need.

    Args:
        claims: to be tested.
        world: name of the world.
        quick: small and short versions.
        runs: runs a side, instead of those of the rule; 0 = the rule.
    """
    members: dict[str, Member] = {}
    wanted: dict[str, int] = {}
    impossible = {}
    for claim in claims:
        for cell in claim.cells:
            why = sides.missing(claim.investigation, cell, world=world)
            if why:
                impossible.setdefault(claim.id, why)
                continue
            count = runs or (QUICK_RUNS if quick else verdict.runs_wanted(cell))
            for side in cell.sides:
                member = sides.member(
                    claim.investigation, side, world=world, quick=quick
                )
                name = member.identity
                members.setdefault(name, member)
                wanted[name] = max(count, wanted.get(name, 0))
    return Need(tuple(members.values()), wanted, impossible)


def run(
    claims: Sequence[Claim],
    engine: Engine,
    *,
    world: str = "mujoco",
    quick: bool = False,
    runs: int = 0,
    root: Path = ROOT,
    mix: bool = False,
    retry: bool = False,
    stop: Callable[[], bool] = lambda: False,
    progress: bool = True,
) -> list[drive.Session]:
    """Run what is missing; first 30 runs of everything, then more where they are due.

    Args:
        claims: to be tested.
        engine: where batches run.
        world: name of the world.
        quick: small and short versions, in a store of their own.
        runs: runs a side, instead of those of the rule.
        root: where stores are.
        mix, retry, stop, progress: as for `bns.campaign.drive.run`.

    Raises:
        BnsError: as `bns.campaign.drive.run`.
    """
    need = needed(claims, world=world, quick=quick, runs=runs)
    out = directory(world, quick=quick, root=root)
    sessions = []
    for count in sorted(set(need.runs.values())):
        members = tuple(m for m in need.members if need.runs[m.identity] >= count)
        campaign = _campaign(members, count, world)
        sessions.append(
            drive.run(
                campaign,
                out,
                engine,
                resume=True,
                retry=retry,
                mix=mix,
                progress=progress,
                stop=stop,
            )
        )
        if sessions[-1].missing:
            break
    return sessions


def _campaign(members: tuple[Member, ...], count: int, world: str) -> Campaign:
    return Campaign(f"claims in {world}", members, count, SEED)


def take(
    claims: Sequence[Claim],
    folders: Sequence[Path],
    *,
    world: str = "mujoco",
    root: Path = ROOT,
) -> list[str]:
    """Use finished runs of `bns run` for claims; gives the directories taken.

    Args:
        claims: to be tested.
        folders: hold run directories.
        world: name of the world.
        root: where stores are.

    Raises:
        BnsError: no such folder, or a run that cannot be read.
    """
    need = needed(claims, world=world)
    campaign = _campaign(need.members, 1, world)
    out = directory(world, quick=False, root=root)
    with Lock(out) as lock:
        store = drive.opened(campaign, out, resume=True, lock=lock)
        store.check_versions()
        store.tidy()
        taken = []
        for folder in folders:
            held = drive.replicates_done(store, campaign)
            taken += adopt(store, folder, need.runs, held)
        store.compact()
    return taken
