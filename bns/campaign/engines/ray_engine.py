"""Ray: batches on the nodes of a cluster, or on one that is started here.

An optional extra. A batch on a node that dies is started on another one, and so is one
that has not finished a trial for too long.
"""

import os
import socket
import time
from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from bns.campaign import work
from bns.campaign.engines.registry import PATIENCE, Beat, Outcome, outcome
from bns.campaign.plan import Job
from bns.errors import BnsError, MissingDependencyError, install

RETRIES = 4
"""times a batch is started again when its worker or node dies"""

LISTEN_SECONDS = 2.0
"""time between two looks at how far the batches are [s]"""

LATE = "timed out during startup"
"""what Ray says, in a plain `Exception`, of a node here that is not up in time"""

ANSWER_SECONDS = 5.0
"""time in which a cluster has to answer [s]"""


class RayEngine:
    """Batches run as Ray tasks of one CPU each.

    Args:
        address: of a cluster, ``host:port`` or ``ray://host:port``; empty starts one
            on this machine.
        workers: CPUs of a cluster that is started here.
        patience: time without a finished trial after which a batch hangs [s].
    """

    name = "ray"

    def __init__(
        self, address: str = "", *, workers: int = 2, patience: float = PATIENCE
    ):
        self.address, self.workers, self.patience = address, workers, patience

    def run(self, jobs: Sequence[Job], *, beat: Beat) -> Generator[Outcome, None, None]:
        """See `Engine.run`."""
        ray = self._start()
        try:
            yield from _Session(ray, self.patience).run(jobs, beat)
        finally:
            ray.shutdown()

    def check(self) -> "RayEngine":
        """This engine, if Ray is there and the cluster answers.

        Raises:
            MissingDependencyError: Ray is not installed.
            BnsError: no address, or nobody answers there.
        """
        if self.address:
            answers(self.address)
        _ray()
        return self

    def _start(self) -> Any:
        ray = _ray()
        options: dict[str, Any] = {"log_to_driver": False, "logging_level": "error"}
        if not self.address:
            options |= {"num_cpus": self.workers, "include_dashboard": False}
            try:
                ray.init(**options)
            except Exception as error:  # Ray has no class for a node that starts late
                if type(error) is not Exception or LATE not in str(error):
                    raise
                raise BnsError(
                    f"Ray does not start here: {work.describe(error)} Try again when "
                    "the machine is less busy, or use --engine local."
                ) from error
            return ray
        self.check()
        try:
            ray.init(address=self.address, **options)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise BnsError(
                f"The Ray cluster at {self.address} does not take this driver: "
                f"{work.describe(error)}"
            ) from error
        return ray


class _Session:
    """All batches of a campaign on a cluster that is up."""

    def __init__(self, ray: Any, patience: float):
        self.ray, self.watch = ray, Watch(patience)
        here = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(
            ray.get_runtime_context().get_node_id(), soft=True
        )
        actor = ray.remote(num_cpus=0, max_restarts=-1, scheduling_strategy=here)
        self.pulse = actor(Pulse).remote()
        self.task = ray.remote(num_cpus=1, max_retries=RETRIES)(_heard)
        self.going: dict[Any, tuple[Job, int, float]] = {}

    def run(self, jobs: Sequence[Job], beat: Beat) -> Generator[Outcome, None, None]:
        """See `Engine.run`."""
        waiting = deque((job, 1) for job in jobs)
        while waiting or self.going:
            room = 4 * max(1, int(self.ray.cluster_resources().get("CPU", 1)))
            while waiting and len(self.going) < room:
                job, attempt = waiting.popleft()
                name = _name(job.key, attempt)
                going = self.task.remote(job.to_mapping(), self.pulse, name)
                self.going[going] = (job, attempt, time.monotonic())
            ready, _ = self.ray.wait(list(self.going), timeout=LISTEN_SECONDS)
            if ready:
                yield self._ended(ready[0])
            for name, trials in self._news().items():
                beat(name.partition(" ")[0], trials)
            for name in self.watch.hanging():
                job, attempt = self._cancelled(name)
                if attempt <= RETRIES:
                    waiting.appendleft((job, attempt + 1))
                else:
                    reason = (
                        f"worker lost: no sign of life for {self.watch.patience:.0f} s"
                    )
                    yield Outcome(job.key, None, reason, attempts=attempt)

    def _ended(self, reference: Any) -> Outcome:
        job, attempt, started = self.going.pop(reference)
        self.watch.forget(_name(job.key, attempt))
        try:
            given = self.ray.get(reference)
        except self.ray.exceptions.RayError as error:
            given = f"worker lost: {work.describe(error)}", 0.0
        ended = outcome(job.key, given, time.monotonic() - started)
        return replace(ended, attempts=attempt)

    def _news(self) -> dict[str, int]:
        """What batches that are going have said since; nothing while nobody listens."""
        try:
            done = self.ray.get(self.pulse.all.remote(), timeout=LISTEN_SECONDS)
        except (self.ray.exceptions.RayError, TimeoutError):
            return {}
        mine = {_name(job.key, attempt) for job, attempt, _ in self.going.values()}
        return self.watch.news({name: done[name] for name in done if name in mine})

    def _cancelled(self, name: str) -> tuple[Job, int]:
        """End a batch that hangs; gives its job and how often it was started."""
        reference = next(
            reference
            for reference, (job, attempt, _) in self.going.items()
            if _name(job.key, attempt) == name
        )
        job, attempt, _ = self.going.pop(reference)
        self.ray.cancel(reference, force=True)
        self.watch.forget(name)
        return job, attempt


def _name(key: str, attempt: int) -> str:
    """Of a batch while it is going; what an attempt said counts for that one only."""
    return f"{key} {attempt}"


def _heard(content: dict[str, Any], pulse: Any, name: str) -> tuple[bytes | str, float]:
    """`work.timed`, saying how far it is."""
    pulse.beat.remote(name, 0)
    return work.timed(content, lambda trials: pulse.beat.remote(name, trials))


def _ray() -> Any:
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError:
        raise MissingDependencyError("--engine ray", "Ray", install("ray")) from None
    return ray


def answers(address: str) -> None:
    """Refuse an address where nobody listens.

    Raises:
        BnsError: not ``host:port``, or nobody answers.
    """
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if address in ("auto", "local"):
        return
    if not (colon and host and port.isdigit() and 0 < int(port) < 65536):
        raise BnsError(
            f"--ray-address {address!r} is no address: give HOST:PORT, as "
            "`ray start --head` prints it."
        )
    try:
        socket.create_connection((host, int(port)), timeout=ANSWER_SECONDS).close()
    except OSError as error:
        raise BnsError(
            f"Nobody answers at {address} ({error}): start a cluster there with "
            f"`ray start --head --port={port}`, or leave --ray-address out to start "
            "one on this machine."
        ) from error


class Pulse:
    """Where batches say how far they are; lives where all of them reach it."""

    def __init__(self) -> None:
        self._done: dict[str, tuple[int, int]] = {}

    def beat(self, key: str, trials: int) -> None:
        """A batch is running and has done so many trials."""
        _, beats = self._done.get(key, (0, 0))
        self._done[key] = trials, beats + 1

    def all(self) -> dict[str, tuple[int, int]]:
        """Trials done, and beats, by batch, of those that have started."""
        return dict(self._done)


class Watch:
    """Who has been heard when, on the driver's clock.

    A batch counts from its first sign of life on: until then it may be waiting for a
    place to run, which is no fault of its.

    Args:
        patience: time without news after which a batch hangs [s].
        clock: seconds, never backwards.
    """

    def __init__(self, patience: float, clock: Callable[[], float] = time.monotonic):
        self.patience, self.clock = patience, clock
        self._heard: dict[str, tuple[tuple[int, int], float]] = {}

    def news(self, done: Mapping[str, tuple[int, int]]) -> dict[str, int]:
        """Trials of those reports that are new, noted as heard now."""
        now = self.clock()
        new = {
            key: said
            for key, said in done.items()
            if key not in self._heard or self._heard[key][0] != said
        }
        self._heard.update({key: (said, now) for key, said in new.items()})
        return {key: trials for key, (trials, _) in new.items()}

    def forget(self, key: str) -> None:
        """The batch is done, or starts anew."""
        self._heard.pop(key, None)

    def hanging(self) -> list[str]:
        """Batches that have been silent for too long."""
        now = self.clock()
        return [
            key
            for key, (_, heard) in self._heard.items()
            if now - heard > self.patience
        ]
