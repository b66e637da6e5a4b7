"""What tests of robots share: devices on their ports, guards, and patience."""

import threading
import time
from contextlib import contextmanager

import pytest

SLOW = 20.0  # s; a busy machine


@pytest.fixture
def serving():
    """Has a device on its port (a `PtyHost`) while a block goes on."""

    @contextmanager
    def serve(host, *also):
        done = threading.Event()
        thread = threading.Thread(target=host.serve, args=(done.is_set, *also))
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()
            host.unplug()

    return serve


@pytest.fixture
def waited():
    """Waits until something is true; gives that, or None where it never was."""

    def wait(good):
        until = time.monotonic() + SLOW
        while time.monotonic() < until:
            if found := good():
                return found
            time.sleep(0.01)
        return None

    return wait


@pytest.fixture
def guard():
    """Stands where the watchdog does, remembers what it is fed, raises its `error`."""

    class Guard:
        def __init__(self):
            self.fed, self.error = [], None

        def feed(self, *, moving):
            self.fed.append(moving)
            if self.error:
                raise self.error

    return Guard()
