"""Run what the standings lack; sides that share trials train them once."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bns.campaign import drive
from bns.campaign.drive import Session, Stop
from bns.campaign.engines.registry import Engine
from bns.campaign.file import Campaign, Member
from bns.campaign.plan import Job
from bns.claims import schedule
from bns.claims.runner import work
from bns.experiment import versions
from bns.experiment.batch import check_world
from bns.learners import registry as learners
from bns.standings.design import Entry
from bns.storage.lock import Lock

ROOT = Path("runs/standings")
BLOCK = 10
"""runs of a batch"""
SECONDS = {
    ("walk", "bns"): 0.55,
    ("walk", "other"): 0.16,
    ("navigate", "bns"): 0.16,
    ("navigate", "other"): 0.06,
    ("light", "bns"): 1.5,
    ("light", "other"): 0.1,
}
"""processor time of a trial of one run [s], by task and learner; estimated, in batches
of ten runs on an AMD EPYC core"""
EVALUATION = {"walk": 0.031, "navigate": 0.02, "light": 0.04}
"""processor time of an evaluation of the model [s]"""


def hours(entries: Sequence[Entry], runs: int) -> dict[tuple[str, str, str], float]:
    """Processor hours of a part of the standings, from nothing.

    Args:
        entries: its cells.
        runs: of each.

    Returns:
        (task, rival, prior) -> hours; trials before the damage are counted once.
    """
    found: dict[tuple[str, str, str], float] = {}
    for entry in entries:
        config, key = entry.member.config, (entry.task, entry.rival, entry.prior)
        kind = "bns" if "snn" in learners.sections(config.learner) else "other"
        second = SECONDS[entry.task, kind]
        onset = config.trials - 50
        evaluations = config.prior.evaluations if config.prior.world else 0
        once = onset * second + evaluations * EVALUATION[entry.task]
        spent = (config.trials - onset) * second + (0 if key in found else once)
        found[key] = found.get(key, 0.0) + runs * spent / 3600
    return found


def jobs(
    entries: Sequence[Entry], runs: int, done: dict[str, int], store: Path
) -> list[Job]:
    """The batches that are missing, trunks first.

    Args:
        entries: cells.
        runs: of each.
        done: identity -> runs that are there.
        store: where trunks are kept.
    """
    code = versions.commit()
    made = {}
    for member in (entry.member for entry in entries):
        for start in range(done.get(member.identity, 0), runs, BLOCK):
            count = min(BLOCK, runs - start)
            job = schedule.job(member, start, count, store)
            made[job.key] = replace(job, commit=code)
    return [*schedule.trunks(list(made.values())), *made.values()]


def run(
    entries: Sequence[Entry],
    engine: Engine,
    *,
    runs: int,
    root: Path = ROOT,
    retry: bool = False,
    mix: bool = False,
    progress: bool = True,
    stop: Stop = lambda: False,
) -> Session:
    """Run what is missing of a part of the standings.

    Args:
        entries: its cells.
        engine: where batches run.
        runs: of each cell.
        root: directory of the store.
        retry: try batches again that failed before.
        mix: allow results of several package versions in one store.
        progress: show it on the standard error stream.
        stop: asked after every batch; True ends the session there.

    Raises:
        BnsError: a setting that is not allowed, or a store of another version.
    """
    members: dict[str, Member] = {e.member.identity: e.member for e in entries}
    for member in members.values():
        check_world(member.config)
    campaign = Campaign("standings", tuple(members.values()), runs, schedule.SEED)
    session = Session()
    with Lock(root) as lock:
        store = drive.opened(
            campaign, root, resume=True, lock=lock, mix=mix, retry=retry
        )
        done = drive.replicates_done(store, campaign)
        todo = jobs(entries, runs, done, root)
        known = store.failures()
        session.waiting = sum(job.key in known for job in todo)
        todo = [job for job in todo if job.key not in known]
        work(
            todo,
            store,
            engine,
            session,
            title="standings",
            stop=stop,
            progress=progress,
        )
        store.compact()
    return session
