"""Run what claims need, look by look, in a store of its own for each world."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from bns.campaign import drive
from bns.campaign.drive import Progress, Session, Stop
from bns.campaign.engines.registry import Engine
from bns.campaign.file import Campaign, Member
from bns.campaign.plan import Job
from bns.campaign.store import CampaignStore, adopt
from bns.claims import provenance, report, schedule
from bns.claims.claim import Claim, lacking
from bns.claims.report import Judged
from bns.experiment.batch import check_device
from bns.storage.lock import Lock

ROOT = Path("runs/claims")
QUICK_RUNS = 6

Found = Callable[[], None]


def directory(world: str, *, quick: bool, root: Path = ROOT) -> Path:
    """Where the runs for claims in a world are kept.

    Args:
        world: key of the investigation's `worlds`.
        quick: whether they are the small and short versions, kept apart.
        root: of all claims.
    """
    return root / (f"{world}-quick" if quick else world)


def impossible(claims: Iterable[Claim], *, world: str) -> dict[str, str]:
    """Claims of which comparisons cannot run in a world, and why."""
    found: dict[str, str] = {}
    for claim in claims:
        for cell in claim.cells:
            why = lacking(claim.investigation, cell, world=world)
            if why:
                found.setdefault(claim.id, why)
    return found


def run(
    claims: Sequence[Claim],
    engine: Engine,
    *,
    world: str = "mujoco",
    quick: bool = False,
    runs: int = 0,
    root: Path = ROOT,
    own: bool = True,
    mix: bool = False,
    retry: bool = False,
    stop: Stop = lambda: False,
    progress: bool = True,
    found: Found = lambda: None,
) -> Session:
    """Run what is missing: all comparisons to their first look, then those that go on.

    Args:
        claims: to be tested.
        engine: where batches run.
        world: name of the world.
        quick: small and short versions, in a store of their own.
        runs: runs a side at most, instead of those of the design; 0 = the design's.
        root: where stores are.
        own: by runs of this store alone; else what is published of today's settings
            need not be run, and runs that are published are gone on from.
        mix: allow results of several package versions in one store.
        retry: try batches again that failed before.
        stop: asked after every batch; True ends the session there.
        progress: show it on the standard error stream.
        found: called after every batch, when there may be new findings, and at the end.

    Raises:
        BnsError: a store of another version, or one that is being written.
    """
    out = directory(world, quick=quick, root=root)
    last = runs or (QUICK_RUNS if quick else 0)
    check_device("cpu")
    session = Session()
    with Lock(out) as lock:
        store = drive.opened(
            _campaign((), world), out, resume=True, lock=lock, mix=mix, retry=retry
        )
        while not session.stopped:
            rows = report.judged(
                claims, out, world=world, quick=quick, own=own, runs=last
            )
            todo = _round(rows, store, world, session, quick=quick, runs=last, own=own)
            if not todo:
                break
            if progress and not quick:
                print(schedule.left(rows, world=world))
            work(
                todo,
                store,
                engine,
                session,
                title=f"claims in {world}",
                stop=stop,
                progress=progress,
                found=found,
            )
        store.compact()
    return session


def _round(
    rows: Sequence[Judged],
    store: CampaignStore,
    world: str,
    session: Session,
    *,
    quick: bool,
    runs: int,
    own: bool,
) -> list[Job]:
    """The batches to run next; none that failed."""
    wanted = schedule.due(rows, world=world, quick=quick, runs=runs)
    members = {m.identity: m for each in wanted for m in each.members}
    have = report.held(members.values(), store.directory, own=own or quick)
    done = {name: each.runs for name, each in have.items()}
    jobs = schedule.jobs(wanted, done, store.directory)
    known = {*store.failures(), *session.failed}
    session.waiting = sum(job.key in known for job in jobs)
    return [job for job in jobs if job.key not in known]


def work(
    jobs: Sequence[Job],
    store: CampaignStore,
    engine: Engine,
    session: Session,
    *,
    title: str,
    stop: Stop,
    progress: bool,
    found: Found = lambda: None,
) -> None:
    """Run batches, trunks before the sides that begin with them.

    Args:
        jobs: the batches.
        store: what keeps them.
        engine: where they run.
        session: what was done, which is counted on.
        title: of the progress.
        stop: asked after every batch; True ends the session there.
        progress: show it on the standard error stream.
        found: told of every batch with runs.
    """
    for part in phases(jobs):
        shown = Progress(title, part, 0, enabled=progress)
        drive.work(part, store, engine, shown, session, stop=stop, found=found)
        if session.stopped:
            return


def phases(jobs: Sequence[Job]) -> Iterator[list[Job]]:
    """Batches that make trunks, then those that begin with one."""
    for grows in (True, False):
        part = [job for job in jobs if job.grows == grows]
        if part:
            yield part


def _campaign(members: tuple[Member, ...], world: str) -> Campaign:
    return Campaign(f"claims in {world}", members, 1, schedule.SEED)


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
    members = report.sides(claims, world)
    campaign = _campaign(tuple(members.values()), world)
    out = directory(world, quick=False, root=root)
    with Lock(out) as lock:
        store = drive.opened(campaign, out, resume=True, lock=lock)
        taken = []
        for folder in folders:
            have = provenance.read(out, report.identities(members.values()))
            taken += adopt(store, folder, set(members), set(have))
        store.compact()
    return taken
