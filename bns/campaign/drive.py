"""The loop around a campaign: what is missing is run and stored as it comes."""

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from bns.campaign.engines.registry import Engine, Outcome
from bns.campaign.file import Campaign
from bns.campaign.identity import changed_default
from bns.campaign.plan import Job, plan
from bns.campaign.store import FILE, CampaignStore
from bns.errors import BnsError
from bns.experiment.batch import check_device, check_world
from bns.progress import Bar, duration
from bns.storage import files, seal
from bns.storage.lock import Lock


class Progress:
    """What a campaign shows of itself on the standard error stream.

    Work is counted in trials of runs; what a batch has done so far counts as well.

    Args:
        name: of the campaign.
        jobs: what this session has to run.
        done: trials of runs that lie behind already.
        enabled: False shows nothing.
    """

    def __init__(
        self, name: str, jobs: Sequence[Job], done: int, *, enabled: bool = True
    ):
        self.name, self.enabled = name, enabled
        self.jobs = {job.key: job for job in jobs}
        self.before, self.total = done, done + sum(job.work for job in jobs)
        self.share = dict.fromkeys(self.jobs, 0.0)
        self.ended = self.failed = 0
        self.began = time.monotonic()
        self.bar: Bar | None = None

    @contextmanager
    def start(self) -> Iterator[None]:
        """Show progress inside the block."""
        if not self.enabled:
            yield
            return
        with Bar(self.name, self.total, done=self.before, counted=False) as self.bar:
            yield

    def beat(self, key: str, trials: int) -> None:
        """A batch has done so many trials."""
        job = self.jobs[key]
        longest = next(iter(job.configs.values())).trials
        self.share[key] = min(1.0, trials / longest)
        self._show()

    def end(self, key: str, *, failed: bool) -> None:
        """A batch has ended."""
        self.share[key] = 1.0
        self.ended += 1
        self.failed += failed
        self._show()

    @property
    def here(self) -> float:
        """Trials of runs done in this session."""
        return sum(self.share[key] * job.work for key, job in self.jobs.items())

    def left(self) -> float:
        """Estimated time to the end [s]; infinite before anything is done."""
        here, seconds = self.here, time.monotonic() - self.began
        todo = self.total - self.before - here
        return seconds * todo / here if here else float("inf")

    def text(self) -> str:
        """Where the campaign is, in words."""
        share = 100 * (self.before + self.here) / max(self.total, 1)
        said = f"{share:.0f} %, {self.ended} of {len(self.jobs)} batches"
        if self.failed:
            said += f", {self.failed} failed"
        return f"{said}, {duration(self.left())} left"

    def _show(self) -> None:
        if not self.bar:
            return
        failed = f", {self.failed} failed" if self.failed else ""
        brief = f"{self.ended} of {len(self.jobs)} batches{failed}"
        self.bar.update(self.before + self.here, brief, line=self.text())


Stop = Callable[[], bool]


@dataclass
class Session:
    """What a call that runs batches did.

    Attributes:
        done: batches it ran, trunks among them.
        failed: batches that failed, by key, with the reason.
        waiting: batches that failed before and were not tried again.
        missing: batches of a campaign that it was stopped before.
        stopped: whether it was told to stop.
    """

    done: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    waiting: int = 0
    missing: int = 0
    stopped: bool = False


def run(
    campaign: Campaign,
    out: Path | str,
    engine: Engine,
    *,
    resume: bool = False,
    retry: bool = False,
    mix: bool = False,
    progress: bool = False,
    stop: Stop = lambda: False,
) -> Session:
    """Run what is missing of a campaign.

    Args:
        campaign: what is wanted.
        out: directory of its store.
        engine: where batches run.
        resume: go on with the store in `out`.
        retry: try batches again that failed before.
        mix: allow results of several package versions in one store.
        progress: show it on the standard error stream.
        stop: asked after every batch; True ends the session there.

    Raises:
        BnsError: a setting that is not allowed, a directory that is not free, or a
            store of another campaign or version.
    """
    for member in campaign.members:
        check_device(member.config.device)
        check_world(member.config)
    with Lock(out) as lock:
        store = opened(
            campaign, Path(out), resume=resume, lock=lock, mix=mix, retry=retry
        )
        if campaign.text:
            text = seal.sealed_text(campaign.text)
            files.write_text(store.directory / FILE, text)
        done = replicates_done(store, campaign)
        jobs = plan(campaign, done)
        known = store.failures()
        todo = [job for job in jobs if job.key not in known]
        trials = {member.identity: member.config.trials for member in campaign.members}
        behind = sum(trials[i] * count for i, count in done.items() if i in trials)
        shown = Progress(campaign.name, todo, behind, enabled=progress)
        session = Session(waiting=len(jobs) - len(todo))
        store.note(event="start", engine=engine.name, batches=len(todo))
        work(todo, store, engine, shown, session, stop=stop)
        finished, failed = session.done, len(session.failed)
        session.missing = len(todo) - finished - failed
        store.note(event="end", done=finished, failed=failed, missing=session.missing)
        store.compact()
    return session


def opened(
    campaign: Campaign,
    out: Path,
    *,
    resume: bool,
    lock: Lock,
    mix: bool = False,
    retry: bool = False,
) -> CampaignStore:
    """The store to go on with, or a new one, in a directory that is locked.

    Args:
        campaign: what is to run.
        out: directory of the store.
        resume: whether to go on with a store that is there.
        lock: held on that directory; the store keeps it.
        mix: allow results of several package versions in it.
        retry: forget which batches failed before.

    Raises:
        BnsError: the directory is not free, or holds a campaign of another seed or
            version.
    """
    if not (resume and (out / "campaign.json").exists()):
        store = CampaignStore.create(out, campaign.name, campaign.seed, lock)
    else:
        store = CampaignStore.open(out)
        store.lock = lock
    if store.seed != campaign.seed:
        raise BnsError(
            f"{out} was made with seed = {store.seed}, the file says {campaign.seed}: "
            "give the file that seed, or another --out."
        )
    if not mix:
        store.check_versions()
    store.tidy()
    if retry:
        store.forgive()
    return store


def replicates_done(store: CampaignStore, campaign: Campaign) -> dict[str, int]:
    """Identity -> replicates stored without a gap.

    Raises:
        BnsError: a configuration was stored under other defaults.
    """
    wanted = {member.identity: member.config for member in campaign.members}
    found: dict[str, list[tuple[int, int]]] = {}
    for part in store.read():
        for block in part.blocks:
            if block.identity in wanted:
                changed = changed_default(wanted[block.identity], block.config)
                if changed:
                    raise BnsError(
                        f"{store.directory} was made with another default: {changed}. "
                        "Set it in the campaign file, or give another directory "
                        "(--out, for claims --root)."
                    )
            found.setdefault(block.identity, []).append((block.start, block.count))
    return {identity: _reach(blocks) for identity, blocks in found.items()}


def _reach(blocks: list[tuple[int, int]]) -> int:
    """Replicates from the first on without a gap."""
    reached = 0
    for start, count in sorted(blocks):
        if start > reached:
            break
        reached = max(reached, start + count)
    return reached


def work(
    jobs: Sequence[Job],
    store: CampaignStore,
    engine: Engine,
    shown: Progress,
    session: Session,
    *,
    stop: Stop,
    found: Callable[[], None] = lambda: None,
) -> None:
    """Run batches until there are no more, or until it is told to stop.

    Args:
        jobs: the batches.
        store: what keeps them.
        engine: where they run.
        shown: how far they are.
        session: what was done, which is counted on.
        stop: asked after every batch; True ends the session there.
        found: told of every batch with runs.
    """
    with closing(ended(jobs, store, engine, shown)) as outcomes:
        for outcome in outcomes:
            if outcome.data is None:
                session.failed[outcome.key] = outcome.reason
            elif outcome.data:
                found()
            session.done += outcome.data is not None
            if stop():
                session.stopped = True
                return


def ended(
    jobs: Sequence[Job], store: CampaignStore, engine: Engine, shown: Progress
) -> Generator[Outcome, None, None]:
    """Run batches; each is kept, noted and shown before it is told of.

    Args:
        jobs: the batches.
        store: where results and failures are kept; a batch that made a trunk has none.
        engine: where they run.
        shown: how far they are.
    """
    with shown.start(), closing(engine.run(jobs, beat=shown.beat)) as outcomes:
        for outcome in outcomes:
            attempts = outcome.attempts
            if outcome.data is None:
                store.fail(outcome.key, reason=outcome.reason, attempts=attempts)
            elif outcome.data:
                store.add(outcome.key, outcome.data)
            store.note(
                batch=outcome.key,
                seconds=round(outcome.seconds, 3),
                computed=round(outcome.computed, 3),
                attempts=attempts,
            )
            shown.end(outcome.key, failed=outcome.data is None)
            yield outcome
