"""Whether another program has opened a port: who reads it as well steals answers."""

import contextlib
import ctypes
import os
import struct
from pathlib import Path

OPENED = 0x20  # IN_OPEN of inotify(7)
NOT_BLOCKING = os.O_NONBLOCK | os.O_CLOEXEC  # IN_NONBLOCK, IN_CLOEXEC are the same
EVENT = struct.Struct("iIII")  # struct inotify_event, its name left out


class Openers:
    """Notes when somebody opens a port that is open here.

    The kernel tells (inotify), whoever it is; asking costs microseconds. On a system
    that has no such thing nobody is ever seen.

    Args:
        port: device; opened already. Who else holds it by then (the process of an
            emulated robot does) is none of the others.
    """

    def __init__(self, port: str) -> None:
        self._port, self._come = os.path.realpath(port), False
        self._known = _holders(self._port).keys()
        self._events = -1
        with contextlib.suppress(OSError, AttributeError):
            library = ctypes.CDLL(None, use_errno=True)
            self._events = library.inotify_init1(NOT_BLOCKING)
            name = os.fsencode(self._port)
            library.inotify_add_watch(self._events, name, OPENED)

    def intruder(self) -> bool:
        """Whether somebody has opened the port since it was last asked."""
        with contextlib.suppress(OSError):  # BlockingIOError: nobody
            data = os.read(self._events, 4096)
            come = bool(EVENT.unpack_from(data)[1] & OPENED)
            self._come = self._come or come
            return come
        return False

    def others(self) -> list[str]:
        """Programs that have the port open now, as "name (number)".

        Looked for once somebody was seen to open it. Those of other users cannot be
        seen without the administrator's rights.
        """
        self.intruder()
        if not self._come:
            return []
        found = sorted(_holders(self._port).items())
        others = [f"{name} ({pid})" for pid, name in found if pid not in self._known]
        self._come = bool(others)
        return others

    def close(self) -> None:
        """Look no more."""
        with contextlib.suppress(OSError):
            os.close(self._events)
        self._events = -1


def _holders(port: str) -> dict[int, str]:
    """Names of the processes that have a device open, this one and its own left out.

    Args:
        port: device, no link to one.
    """
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, IndexError):
            if not any(_is(number, port) for number in (folder / "fd").iterdir()):
                continue
            name, rest = (folder / "stat").read_text().split("(", 1)[1].rsplit(")", 1)
            if os.getpid() not in (int(folder.name), int(rest.split()[1])):
                found[int(folder.name)] = name
    return found


def _is(number: Path, port: str) -> bool:
    """Whether an open file of a process is a device."""
    with contextlib.suppress(OSError):
        return os.readlink(number) == port and os.path.samefile(number, port)
    return False
