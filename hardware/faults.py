"""What can go wrong with a robot on a line, and what did: noted one by one."""

import contextlib
import json
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from bns.errors import BnsError
from bns.hardware.clock import Clock


class LinkError(BnsError):
    """The line to the robot is dead, or nothing that can be understood comes back."""


class SafetyStop(BnsError):
    """The robot was stopped before its commands were done.

    Args:
        reason: what happened, in a few words.
        advice: what to do now.
    """

    def __init__(self, reason: str, advice: str = "look at the robot, then go on"):
        self.reason = reason
        super().__init__(f"The robot was stopped: {reason}; {advice}.")


class Void(BnsError):
    """A trial that was not executed as told; it is repeated, never learned from.

    Args:
        reason: what happened, in a few words.
        advice: what to do where it happens again at once, so that going on would be
            no use or no good; empty = it is repeated as often as others.
    """

    def __init__(self, reason: str, advice: str = ""):
        self.reason, self.advice = reason, advice
        super().__init__(f"The trial is void: {reason}; it has to be repeated.")


KEPT = 100_000  # faults kept in memory


class Fault(NamedTuple):
    """One thing that went wrong.

    Attributes:
        at: time on the session's clock [s].
        kind: "no answer", "garbled answer", ...
        about: command or part that it concerns.
        seen: what was there instead, as text.
    """

    at: float
    kind: str
    about: str
    seen: str


class FaultLog:
    """All faults of a session.

    Args:
        clock: of the session.
        path: file to append each fault to, a JSON line each, once its directory is
            there; None keeps them here.
    """

    def __init__(self, clock: Clock, path: Path | str | None = None):
        self.clock = clock
        self.path = Path(path) if path else None
        self.faults: list[Fault] = []
        self.counts: Counter[str] = Counter()
        self._unwritten: list[Fault] = []

    def note(self, kind: str, about: bytes | str = "", seen: bytes | str = "") -> None:
        """Add a fault.

        Args:
            kind: "no answer", "garbled answer", ...
            about: command or part that it concerns.
            seen: what was there instead.
        """
        fault = Fault(round(self.clock.now(), 4), kind, _text(about), _text(seen))
        self.counts[kind] += 1
        if len(self.faults) < KEPT:
            self.faults.append(fault)
        if self.path:
            self._unwritten.append(fault)
        if self.path and self.path.parent.is_dir():
            with contextlib.suppress(OSError):  # a full disk stops no robot
                self._write(self.path)

    def _write(self, path: Path) -> None:
        with open(path, "a", encoding="utf-8") as file:
            file.writelines(json.dumps(f._asdict()) + "\n" for f in self._unwritten)
        self._unwritten.clear()

    def __len__(self) -> int:
        return sum(self.counts.values())


def _text(data: bytes | str) -> str:
    if isinstance(data, bytes):
        return data[:80].decode("ascii", "backslashreplace").strip()
    return data
