"""Whether another program has opened a port: who reads it as well steals answers."""

import contextlib
import ctypes
import os
import struct

OPENED = 0x20  # IN_OPEN of inotify(7)
NOT_BLOCKING = os.O_NONBLOCK | os.O_CLOEXEC  # IN_NONBLOCK, IN_CLOEXEC are the same
EVENT = struct.Struct("iIII")  # struct inotify_event, its name left out


class Openers:
    """Notes when somebody opens a port that is open here.

    The kernel tells (inotify), whoever it is; asking costs microseconds. On a system
    that has no such thing nobody is ever seen.

    Args:
        port: device; opened already.
    """

    def __init__(self, port: str) -> None:
        self._events = -1
        with contextlib.suppress(OSError, AttributeError):
            library = ctypes.CDLL(None, use_errno=True)
            self._events = library.inotify_init1(NOT_BLOCKING)
            name = os.fsencode(os.path.realpath(port))
            library.inotify_add_watch(self._events, name, OPENED)

    def intruder(self) -> bool:
        """Whether somebody has opened the port since it was last asked."""
        with contextlib.suppress(OSError):  # BlockingIOError: nobody
            data = os.read(self._events, 4096)
            return bool(EVENT.unpack_from(data)[1] & OPENED)
        return False

    def close(self) -> None:
        """Look no more."""
        with contextlib.suppress(OSError):
            os.close(self._events)
        self._events = -1
