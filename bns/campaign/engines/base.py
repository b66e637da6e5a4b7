"""What engines have in common."""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Protocol

from bns.campaign.plan import Job

Beat = Callable[[str, int], None]
"""called with a job's key and the trials it has done"""

PATIENCE = 900.0
"""time without a sign of life after which a worker hangs [s]; compiling takes 60"""


@dataclass(frozen=True)
class Outcome:
    """How a batch ended.

    Attributes:
        key: of the job.
        data: the bytes of its part; None where it failed.
        reason: why it failed.
        seconds: from its start to its end, as the driver saw it.
        computed: the part of them in which it was computed.
        attempts: times it was started.
    """

    key: str
    data: bytes | None = None
    reason: str = ""
    seconds: float = 0.0
    attempts: int = 1
    computed: float = 0.0


class Engine(Protocol):
    """Somewhere batches run."""

    name: str

    def run(self, jobs: Sequence[Job], *, beat: Beat) -> Generator[Outcome, None, None]:
        """Run all jobs; gives each outcome as soon as it is known.

        Raises:
            BnsError: the engine cannot start.
        """
        ...


def outcome(key: str, timed: tuple[bytes | str, float], seconds: float) -> Outcome:
    """The outcome in what `work.timed` gave.

    Args:
        key: of the job.
        timed: the bytes of its part, or why it failed; and the time it took [s].
        seconds: from its start to its end, as the driver saw it [s].
    """
    given, computed = timed
    if isinstance(given, str):
        return Outcome(key, None, given, seconds, computed=computed)
    return Outcome(key, given, "", seconds, computed=computed)
