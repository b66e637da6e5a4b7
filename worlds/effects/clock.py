"""The clock by which a log is stamped."""

from typing import Any

from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, strength


class LogClock(BodyEffect):
    """The clock that stamps commands and readings of a log is fast or slow.

    The robot has moved for less or more time than the log tells: a loop is taken to run
    at 250 Hz and runs at 240, or a simulation's step is not the one told.
    """

    name = "log_clock"
    source = "a constant rate: every physics step takes so much less of the log's time"
    robots = ("own",)
    choices = parts.part("model")
    parameter = strength(
        "rate",
        "1",
        (-0.5, 0.5),
        "seconds gained per second; bounds assumed",
        example=0.1,
    )

    def _write(self, spec: Any) -> None:
        parts.among((parts.ALL,), self["part"], "part that has a clock")
        spec.option.timestep /= 1 + self["rate"]
