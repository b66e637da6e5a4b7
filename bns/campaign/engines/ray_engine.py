"""Ray: batches on the nodes of a cluster, or on one that is started here.

An optional extra. A batch on a node that dies is started on another one.
"""

import os
import socket
import time
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

from bns.campaign import work
from bns.campaign.engines.base import Beat, Outcome, outcome
from bns.campaign.plan import Job
from bns.errors import BnsError, MissingDependencyError

RETRIES = 4
"""times a batch is started again when its worker or node dies"""

ANSWER_SECONDS = 5.0
"""time in which a cluster has to answer [s]"""


class RayEngine:
    """Batches run as Ray tasks of one CPU each.

    Args:
        address: of a cluster, ``host:port`` or ``ray://host:port``; empty starts one
            on this machine.
        workers: CPUs of a cluster that is started here.
    """

    name = "ray"

    def __init__(self, address: str = "", *, workers: int = 2):
        self.address, self.workers = address, workers

    def run(self, jobs: Sequence[Job], *, beat: Beat) -> Iterator[Outcome]:
        """See `Engine.run`."""
        ray = self._start()
        try:
            task = ray.remote(num_cpus=1, max_retries=RETRIES)(work.timed)
            yield from self._all(ray, task, jobs)
        finally:
            ray.shutdown()

    def _all(self, ray: Any, task: Any, jobs: Sequence[Job]) -> Iterator[Outcome]:
        waiting = deque(jobs)
        going: dict[Any, tuple[str, float]] = {}
        while waiting or going:
            room = 4 * max(1, int(ray.cluster_resources().get("CPU", 1)))
            while waiting and len(going) < room:
                job = waiting.popleft()
                going[task.remote(job.to_mapping())] = (job.key, time.monotonic())
            ready, _ = ray.wait(list(going), num_returns=1)
            key, started = going.pop(ready[0])
            try:
                given = ray.get(ready[0])
            except ray.exceptions.RayError as error:
                given = f"worker lost: {work.describe(error)}", 0.0
            yield outcome(key, given, time.monotonic() - started)

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
            except Exception as error:
                if type(error) is not Exception:  # Ray has no class for this one
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


def _ray() -> Any:
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError:
        raise MissingDependencyError(
            "--engine ray", "Ray", "pip install 'bns-testbed[ray]'"
        ) from None
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
