"""Runs and campaigns whose processes are killed, and engines that agree."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from bench.result import Result, bench
from bench.storage.campaigns import held, text, tiny
from bns import seeding
from bns.campaign import drive
from bns.campaign.engines import registry
from bns.campaign.engines.ray_engine import RayEngine
from bns.campaign.engines.registry import Beat, InlineEngine, Outcome
from bns.campaign.plan import Job
from bns.campaign.store import CampaignStore
from bns.errors import MissingDependencyError

MAY_DIFFER = ("timing.jsonl",)
SETTINGS = (
    "--trials", "12", "--replicates", "3", "--record-replicates", "2",
    "--evolution.population", "20", "--evolution.generations", "5",
    "--snn.epochs", "20", "--compiled", "no", "--rerun", "off", "--no-report",
    "--world.damage", "wheel_gain:wheel=left,factor=0.8@6",
)  # fmt: skip


@bench(
    "runs killed (SIGKILL) at random moments that resume to the same bytes",
    bar="10 of 10",
)
def resume(quick: bool) -> Result:
    """Kill and resume; a moment is a random share of an undisturbed run's time."""
    count = 2 if quick else 10
    rng = seeding.generator(0, "bench", "resume")
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        whole, first_step = _undisturbed(home / "clean")
        expected = _contents(home / "clean")
        kills = []
        for index in range(count):
            moment = float(rng.uniform(0.5 * first_step, whole))
            trials = _killed(home / f"{index}", moment)
            _finish(_demo(home / f"{index}"))
            kills.append(
                {
                    "seconds": round(moment, 2),
                    "trials_done": trials,
                    "differing": _differing(_contents(home / f"{index}"), expected),
                }
            )
    same = sum(not kill["differing"] for kill in kills)
    return Result(
        figure=same,
        unit=f"of {count}",
        holds=same == count,
        n=count,
        details={"kills": kills, "undisturbed_seconds": round(whole, 2)},
    )


def _demo(out: Path) -> subprocess.Popen:
    return _start("run", "demo", "--out", out, *SETTINGS, "--resume")


def _undisturbed(out: Path) -> tuple[float, float]:
    """Seconds that a whole run takes, and seconds to its first stored trial."""
    began, first = time.monotonic(), np.inf
    process = _demo(out)
    while process.poll() is None:
        if np.isinf(first) and (out / "steps" / "00000.npz").exists():
            first = time.monotonic() - began
        time.sleep(0.01)
    if process.returncode != 0:
        raise RuntimeError(f"the undisturbed run exited with {process.returncode}")
    return time.monotonic() - began, first


def _killed(out: Path, moment: float) -> int:
    """Kill a run after so many seconds; gives the trials it had stored."""
    process = _demo(out)
    try:
        process.wait(timeout=moment)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        process.wait()
    return len(list((out / "steps").glob("[0-9]*.npz")))


def _contents(directory: Path) -> dict[str, bytes]:
    """Bytes of every file, the commit's name left out: it may change meanwhile."""
    head = json.loads((directory / "run.json").read_bytes())
    commit = head["versions"]["commit"].encode()
    files = held(directory, without=MAY_DIFFER)
    return {name: data.replace(commit, b"commit") for name, data in files.items()}


def _differing(one: dict[str, bytes], other: dict[str, bytes]) -> list[str]:
    names = sorted({*one, *other})
    return [name for name in names if one.get(name) != other.get(name)]


WORKERS = 2


@bench(
    "200 batches, 30 workers killed at random, then the driver, resumed: batches kept",
    bar="200 of 200, none twice, the bytes of an undisturbed campaign",
)
def campaign_kill(quick: bool) -> Result:
    """Kill (SIGKILL) workers while the first 150 batches run, the driver after 160."""
    batches, kills = (20, 3) if quick else (200, 30)
    rng = seeding.generator(0, "bench", "campaign-kill")
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        file = home / "tiny.toml"
        file.write_text(text(batches, trials=2, replicates=2))
        clean = _finish(_driver(file, home / "clean"))
        moments = np.sort(rng.integers(1, int(0.75 * batches), kills))
        driver = _driver(file, home / "out")
        struck = _strike(driver, home / "out", moments, rng)
        kept = _end_driver(driver, home / "out", int(0.8 * batches))
        changed, last = _resume(file, home / "out", kept)
        store = CampaignStore.open(home / "out")
        done = [part.key for part in store.read()]
        logged = Counter(e["batch"] for e in store.log() if "batch" in e)
        same = held(home / "out") == held(home / "clean")
        details = {
            "workers killed": struck,
            "batches restarted": sum(e.get("attempts", 1) > 1 for e in store.log()),
            "batches kept when the driver was killed": len(kept),
            "of those changed since": changed,
            "batches run twice": sum(count > 1 for count in logged.values()),
            "failed": len(store.failures()),
            "same bytes as undisturbed": same,
            "seconds undisturbed": round(clean, 1),
            "seconds after the driver's death": round(last, 1),
        }
    whole = len(set(done)) == len(done) == batches and same
    clean_log = details["batches run twice"] == changed == details["failed"] == 0
    return Result(
        figure=len(set(done)),
        unit=f"of {batches}",
        holds=None if quick else whole and clean_log and struck == kills,
        n=batches,
        details=details,
    )


def _driver(file: Path, out: Path) -> subprocess.Popen:
    words = ("campaign", "run", file, "--out", out, "--resume")
    return _start(*words, "--workers", WORKERS)


def _start(*words: object) -> subprocess.Popen:
    """`bns` in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "bns", *map(str, words)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )


def _finish(process: subprocess.Popen) -> float:
    """Seconds until it ends."""
    began = time.monotonic()
    if process.wait() != 0:
        raise RuntimeError(f"it exited with {process.returncode}")
    return time.monotonic() - began


def _parts(out: Path) -> dict[str, bytes]:
    """Bytes of the batches that are stored one by one; they may go meanwhile."""
    found = {}
    for path in (out / "parts").glob("[0-9a-f]*.parquet"):
        with suppress(FileNotFoundError):
            found[path.name] = path.read_bytes()
    return found


def _strike(
    driver: subprocess.Popen, out: Path, moments: np.ndarray, rng: np.random.Generator
) -> int:
    """Kill a random worker whenever so many batches are done."""
    struck = 0
    for moment in moments:
        while len(list((out / "parts").glob("[0-9a-f]*.parquet"))) < moment:
            if driver.poll() is not None:
                return struck
            time.sleep(0.01)
        time.sleep(float(rng.uniform(0, 0.5)))
        workers: list[int] = []
        while len(workers) < WORKERS and driver.poll() is None:
            workers = _children(driver.pid)
        os.kill(int(rng.choice(workers)), signal.SIGKILL)
        struck += 1
    return struck


def _end_driver(driver: subprocess.Popen, out: Path, after: int) -> dict[str, bytes]:
    """Kill the driver once so many batches are done; gives what is stored then."""
    while len(list((out / "parts").glob("[0-9a-f]*.parquet"))) < after:
        if driver.poll() is not None:
            raise RuntimeError("the campaign ended before its driver was killed")
        time.sleep(0.01)
    driver.send_signal(signal.SIGKILL)
    driver.wait()
    return _parts(out)


def _resume(file: Path, out: Path, kept: dict[str, bytes]) -> tuple[int, float]:
    """Go on; gives how many stored batches changed meanwhile, and the time it took."""
    driver = _driver(file, out)
    began, changed = time.monotonic(), set()
    while driver.poll() is None:
        time.sleep(0.2)
        for name, data in _parts(out).items():  # at the end they are compacted
            if kept.get(name, data) != data:
                changed.add(name)
    if driver.returncode != 0:
        raise RuntimeError(f"the resumed campaign exited with {driver.returncode}")
    return len(changed), time.monotonic() - began


def _children(pid: int) -> list[int]:
    """Living processes that this one started."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(fields[1]) == pid and fields[0] not in "ZX":
            found.append(int(stat.parent.name))
    return sorted(found)


class Killing:
    """Ray's engine; after some outcomes a node dies.

    Args:
        cluster: of `ray.cluster_utils`.
        node: of it, to be killed.
        after: outcomes.
    """

    name = "ray"

    def __init__(self, cluster: Any, node: Any, after: int):
        self.cluster, self.node, self.after = cluster, node, after
        self.seen = 0

    def run(self, jobs: Sequence[Job], *, beat: Beat) -> Iterator[Outcome]:
        """See `Engine.run`."""
        for outcome in RayEngine(self.cluster.address).run(jobs, beat=beat):
            self.seen += 1
            if self.seen == self.after:
                self.cluster.remove_node(self.node, allow_graceful=False)
            yield outcome


@bench(
    "batches done on two local Ray nodes of which one is killed mid-run",
    bar="all, with the bytes of one process",
)
def ray_node_kill(quick: bool) -> Result:
    """A node of one CPU each; the second is killed after a third of the batches."""
    from ray.cluster_utils import Cluster

    batches = 6 if quick else 16
    campaign = tiny(batches, trials=12)
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        node = cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        engine = Killing(cluster, node, batches // 3)
        with tempfile.TemporaryDirectory() as name:
            home = Path(name)
            session = drive.run(campaign, home / "ray", engine)
            drive.run(campaign, home / "inline", InlineEngine())
            same = held(home / "ray") == held(home / "inline")
    finally:
        cluster.shutdown()
    return Result(
        figure=session.done,
        unit=f"of {batches}",
        holds=session.done == batches and same,
        n=batches,
        details={
            "failed": dict(session.failed),
            "same bytes as in process": same,
            "batches done when the node was killed": engine.after,
        },
    )


ENGINES = ("inline", "local", "ray")


@bench(
    "engines whose stores hold the same bytes: in process, local pool of 2, Ray",
    bar="3 of 3",
)
def engines_agree(quick: bool) -> Result:
    """One campaign on each; members alone in a batch, and sharing one."""
    members = 3 if quick else 6
    digests: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as name:
        for engine in ENGINES:
            try:
                digests[engine] = _digest(engine, members, Path(name))
            except MissingDependencyError as error:
                digests[engine] = f"not run: {error}"
    same = sum(digest == digests["inline"] for digest in digests.values())
    return Result(
        figure=same,
        unit=f"of {len(ENGINES)}",
        holds=same == len(ENGINES),
        n=members,
        details=digests,
    )


def _digest(engine: str, members: int, home: Path) -> str:
    """A digest of the two stores that an engine makes."""
    total = sha256()
    for shared, replicates in ((False, 3), (True, 1)):
        out = home / f"{engine}-{shared}"
        campaign = tiny(members, replicates=replicates)
        if shared:
            from dataclasses import replace

            campaign = replace(campaign, batch_runs=4)
        session = drive.run(campaign, out, registry.make(engine, workers=2))
        if session.failed or session.missing:
            raise RuntimeError(f"{engine}: {session}")
        for path, data in held(out).items():
            total.update(path.encode() + data)
    return total.hexdigest()[:16]
