"""A worker of the local pool: batches in on one pipe, results out on another.

Run as `python -m bns.campaign.engines.worker`. It ends itself when its driver does,
however that ended. A message is one byte of kind, a length, the content.
"""

import json
import os
import queue
import struct
import sys
import threading
import time
from typing import IO

from bns.campaign import work

JOB, BEAT, DONE, FAILED = b"J", b"B", b"D", b"F"
_HEAD = struct.Struct(">cQ")
SECONDS = struct.Struct(">d")
"""stands before the content of DONE and FAILED: time it took to compute [s]"""


def pack(kind: bytes, content: bytes) -> bytes:
    """The bytes of a message."""
    return _HEAD.pack(kind, len(content)) + content


def read_message(stream: IO[bytes]) -> tuple[bytes, bytes] | None:
    """The next message of a blocking stream; None at its end."""
    head = stream.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    kind, length = _HEAD.unpack(head)
    content = stream.read(length)
    return (kind, content) if len(content) == length else None


class Inbox:
    """Messages that arrive in pieces."""

    def __init__(self) -> None:
        self._held = bytearray()

    def feed(self, piece: bytes) -> list[tuple[bytes, bytes]]:
        """The messages that are whole with this piece."""
        self._held += piece
        found = []
        while len(self._held) >= _HEAD.size:
            kind, length = _HEAD.unpack_from(self._held)
            end = _HEAD.size + length
            if len(self._held) < end:
                break
            found.append((kind, bytes(self._held[_HEAD.size : end])))
            del self._held[:end]
        return found


BEAT_SECONDS = 0.2
"""smallest time between two signs of life"""


def main() -> int:
    """Run batches until the driver closes the pipe."""
    out = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a batch prints
    waiting: queue.Queue[bytes] = queue.Queue()
    listener = threading.Thread(
        target=_listen, args=(sys.stdin.buffer, waiting), daemon=True
    )
    listener.start()
    while True:
        _serve(json.loads(waiting.get()), out)


def _listen(stream: IO[bytes], waiting: "queue.Queue[bytes]") -> None:
    """Pass jobs on; at the end of the stream the driver is gone, and so is this."""
    while (message := read_message(stream)) is not None:
        waiting.put(message[1])
    os._exit(0)


def _serve(content: dict, out: IO[bytes]) -> None:
    spoke = time.monotonic()

    def beat(trials: int) -> None:
        """Say that the run goes on, once in a while."""
        nonlocal spoke
        now = time.monotonic()
        if now - spoke >= BEAT_SECONDS:
            spoke = now
            _send(out, BEAT, str(trials).encode())

    _send(out, BEAT, b"0")
    given, seconds = work.timed(content, beat)
    took = SECONDS.pack(seconds)
    if isinstance(given, str):
        _send(out, FAILED, took + given.encode())
    else:
        _send(out, DONE, took + given)


_SPEAKING = threading.Lock()
"""a batch and its pulse speak from threads of their own"""


def _send(out: IO[bytes], kind: bytes, content: bytes) -> None:
    try:
        with _SPEAKING:
            out.write(pack(kind, content))
            out.flush()
    except BrokenPipeError:  # the driver is gone
        os._exit(0)


if __name__ == "__main__":
    main()
