"""The local pool: processes with one thread each, each answerable for one batch.

A worker that is killed or says nothing for too long costs the batch it has, and that
batch alone: it is given to a fresh worker. A pool of the standard library loses every
batch in flight with one worker.

A worker is `python -m bns.campaign.engines.pool`: batches in on one pipe, results out
on another. It ends itself when its driver does, however that ended. A message is one
byte of kind, a length, the content.
"""

import json
import os
import queue
import selectors
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from typing import IO, cast

from bns.campaign import work
from bns.campaign.engines.registry import PATIENCE, Beat, Outcome
from bns.campaign.plan import Job

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


ATTEMPTS = 5
"""times a batch is given to a worker before the worker's death is the batch's fault"""

ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}
LAST_WORDS = 2000  # bytes of a dead worker's standard error that are looked at


class PoolEngine:
    """Batches run in processes of this machine.

    Args:
        workers: processes.
        attempts: times a batch is given to a worker at most.
        patience: time without a sign of life after which a worker is killed [s].
    """

    name = "local"

    def __init__(
        self, workers: int, *, attempts: int = ATTEMPTS, patience: float = PATIENCE
    ):
        self.workers, self.attempts, self.patience = workers, attempts, patience
        self.crew: list[Worker] = []

    def run(self, jobs: Sequence[Job], *, beat: Beat) -> Generator[Outcome, None, None]:
        """See `Engine.run`."""
        waiting = deque((job, 1) for job in jobs)
        self.crew = [Worker() for _ in range(min(self.workers, len(waiting)))]
        try:
            while waiting or any(worker.job for worker in self.crew):
                for worker in self.crew:
                    if waiting and worker.job is None:
                        worker.give(*waiting.popleft())
                for outcome, again in self._turn(beat):
                    if outcome:
                        yield outcome
                    if again:
                        waiting.appendleft(again)
        finally:
            for worker in self.crew:
                worker.stop()

    def _turn(
        self, beat: Beat
    ) -> Iterator[tuple[Outcome | None, tuple[Job, int] | None]]:
        """What happens next: outcomes, and jobs to be given out once more."""
        with selectors.DefaultSelector() as ready:
            for worker in self.crew:
                if worker.job:
                    ready.register(worker.output, selectors.EVENT_READ, worker)
            events = ready.select(timeout=1.0)
        heard = [key.data for key, _ in events]
        for worker in heard:
            yield from self._hear(worker, beat)
        for worker in self.crew:
            if worker.job and worker not in heard:
                quiet = time.monotonic() - worker.heard
                if quiet > self.patience:
                    worker.stop()
                    yield self._lost(worker, f"no sign of life for {quiet:.0f} s")

    def _hear(
        self, worker: "Worker", beat: Beat
    ) -> Iterator[tuple[Outcome | None, tuple[Job, int] | None]]:
        piece = os.read(worker.output.fileno(), 1 << 20)
        if not piece:
            worker.process.wait()
            yield self._lost(worker, worker.last_words())
            return
        worker.heard = time.monotonic()
        for kind, content in worker.inbox.feed(piece):
            key = worker.busy.key
            if kind == BEAT:
                beat(key, int(content))
            else:
                yield worker.end(_ended(key, kind, content)), None

    def _lost(
        self, worker: "Worker", reason: str
    ) -> tuple[Outcome | None, tuple[Job, int] | None]:
        """A worker is gone: another one in its place, its batch once more."""
        job, attempts = worker.busy, worker.attempts
        ended = worker.end(Outcome(job.key, None, f"worker lost: {reason}"))
        worker.stop()
        self.crew[self.crew.index(worker)] = Worker()
        if attempts >= self.attempts:
            return ended, None
        return None, (job, attempts + 1)


def _ended(key: str, kind: bytes, content: bytes) -> Outcome:
    """The outcome in a worker's last message on a batch."""
    size = SECONDS.size
    (computed,) = SECONDS.unpack(content[:size])
    if kind == DONE:
        return Outcome(key, content[size:], computed=computed)
    return Outcome(key, None, content[size:].decode(), computed=computed)


class Worker:
    """A process and the batch it has."""

    def __init__(self) -> None:
        self.errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        self.process = subprocess.Popen(
            [sys.executable, "-m", "bns.campaign.engines.pool"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            bufsize=0,
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,  # Ctrl-C is for the driver alone
        )
        self.input = cast(IO[bytes], self.process.stdin)
        self.output = cast(IO[bytes], self.process.stdout)
        self.inbox = Inbox()
        self.job: Job | None = None
        self.attempts = 0
        self.started = self.heard = time.monotonic()

    @property
    def busy(self) -> Job:
        """The batch it has.

        Raises:
            RuntimeError: it has none.
        """
        if self.job is None:
            raise RuntimeError("This worker has no batch.")
        return self.job

    def give(self, job: Job, attempts: int) -> None:
        """Let it run a batch."""
        self.job, self.attempts = job, attempts
        self.started = self.heard = time.monotonic()
        content = json.dumps(job.to_mapping()).encode()
        message = memoryview(pack(JOB, content))
        try:
            while message:
                message = message[self.input.write(message) :]
        except BrokenPipeError:
            return  # dead already: reading its output will say so

    def end(self, ended: Outcome) -> Outcome:
        """It has no batch any more; gives the outcome with time and attempts."""
        seconds = time.monotonic() - self.started
        self.job = None
        return replace(ended, seconds=seconds, attempts=self.attempts)

    def last_words(self) -> str:
        """How the process ended."""
        code = self.process.returncode
        if code is not None and code < 0:
            return f"killed by {signal.Signals(-code).name}"
        size = self.errors.seek(0, os.SEEK_END)
        self.errors.seek(max(0, size - LAST_WORDS))
        lines = self.errors.read().decode(errors="replace").split("\n")
        said = next((line for line in reversed(lines) if line.strip()), "nothing said")
        return f"exit code {code}: {said.strip()}"

    def stop(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.wait()
        for stream in (self.input, self.output, self.errors):
            stream.close()


if __name__ == "__main__":
    main()
