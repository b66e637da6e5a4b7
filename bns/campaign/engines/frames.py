"""Messages between driver and worker: one byte of kind, a length, the content."""

import struct
from typing import IO

JOB, BEAT, DONE, FAILED = b"J", b"B", b"D", b"F"
_HEAD = struct.Struct(">cQ")
SECONDS = struct.Struct(">d")
"""stands before the content of DONE and FAILED: time it took to compute [s]"""


def pack(kind: bytes, content: bytes) -> bytes:
    """The bytes of a message."""
    return _HEAD.pack(kind, len(content)) + content


def read(stream: IO[bytes]) -> tuple[bytes, bytes] | None:
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
