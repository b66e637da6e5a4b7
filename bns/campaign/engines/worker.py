"""A worker of the local pool: batches in on one pipe, results out on another.

Run as `python -m bns.campaign.engines.worker`. It ends itself when its driver does,
however that ended.
"""

import json
import os
import queue
import sys
import threading
import time
from typing import IO

from bns.campaign import work
from bns.campaign.engines import frames

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
    while (message := frames.read(stream)) is not None:
        waiting.put(message[1])
    os._exit(0)


def _serve(content: dict, out: IO[bytes]) -> None:
    spoke = time.monotonic()

    def beat(trials: int) -> None:
        nonlocal spoke
        now = time.monotonic()
        if now - spoke >= BEAT_SECONDS:
            spoke = now
            _send(out, frames.BEAT, str(trials).encode())

    _send(out, frames.BEAT, b"0")
    given, seconds = work.timed(content, beat)
    took = frames.SECONDS.pack(seconds)
    if isinstance(given, str):
        _send(out, frames.FAILED, took + given.encode())
    else:
        _send(out, frames.DONE, took + given)


def _send(out: IO[bytes], kind: bytes, content: bytes) -> None:
    try:
        out.write(frames.pack(kind, content))
        out.flush()
    except BrokenPipeError:  # the driver is gone
        os._exit(0)


if __name__ == "__main__":
    main()
