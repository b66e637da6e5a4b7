"""Signs of life from batches that run elsewhere, and who gave none for too long."""

import time
from collections.abc import Callable, Mapping


class Pulse:
    """Where batches say how far they are; lives where all of them reach it."""

    def __init__(self) -> None:
        self._done: dict[str, int] = {}

    def beat(self, key: str, trials: int) -> None:
        """A batch is running and has done so many trials."""
        self._done[key] = trials

    def all(self) -> dict[str, int]:
        """Trials done by batch, of those that have started."""
        return dict(self._done)


class Watch:
    """Who has been heard when, on the driver's clock.

    A batch counts from its first sign of life on: until then it may be waiting for a
    place to run, which is no fault of its.

    Args:
        patience: time without news after which a batch hangs [s].
        clock: seconds, never backwards.
    """

    def __init__(self, patience: float, clock: Callable[[], float] = time.monotonic):
        self.patience, self.clock = patience, clock
        self._heard: dict[str, tuple[int, float]] = {}

    def news(self, done: Mapping[str, int]) -> dict[str, int]:
        """Those of the reports that say something new, noted as heard now."""
        now = self.clock()
        new = {
            key: trials
            for key, trials in done.items()
            if key not in self._heard or self._heard[key][0] != trials
        }
        self._heard.update({key: (trials, now) for key, trials in new.items()})
        return new

    def forget(self, key: str) -> None:
        """The batch is done, or starts anew."""
        self._heard.pop(key, None)

    def hanging(self) -> list[str]:
        """Batches that have been silent for too long."""
        now = self.clock()
        return [
            key
            for key, (_, heard) in self._heard.items()
            if now - heard > self.patience
        ]
