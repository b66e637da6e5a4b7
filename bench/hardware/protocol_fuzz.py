"""Random bytes from the robot's side: the drivers neither crash nor hang."""

import numpy as np

from bench.result import Result, bench

CASES = 3000
LONGEST = 5.0  # s of the session's clock that one call may take


class Fuzz:
    """A device that answers with garbage, sometimes after the right beginning."""

    def __init__(self, rng: np.random.Generator):
        self.rng = rng

    def receive(self, data: bytes, now: float) -> list:
        """Garbage."""
        from bns.hardware.emulators.device import Reply

        rng = self.rng
        kind = rng.integers(6)
        size = int(rng.integers(0, 200))
        noise = rng.integers(0, 256, size, dtype=np.uint8).tobytes()
        letter = data[:1].lower()
        ascii_noise = bytes(rng.choice(list(b"0123456789,-dlenx$\r\n"), size).tolist())
        answers = {
            0: noise,
            1: letter + b"," + ascii_noise + b"\r\n",
            2: letter + noise,
            3: b"",
            4: noise * 50,
            5: b"\xff\xff" + noise,
        }
        at = now + float(rng.exponential(0.02))
        return [Reply(at + 0.001 * part, answers[int(kind)]) for part in range(3)]

    def advance(self, now: float) -> None:
        """Nothing moves."""


@bench(
    "answers replaced by random, cut, foreign and endless bytes, both protocols",
    bar="no crash, no hang",
)
def protocol_fuzz(quick: bool) -> Result:
    """Every call of the driver, again and again, in virtual time.

    Allowed are a proper value and a `BnsError`; anything else counts as a crash, more
    than 5 s on the session's clock as a hang. The figure is their number.
    """
    from bns.errors import BnsError
    from bns.hardware.clock import VirtualClock
    from bns.hardware.emulators.device import VirtualLine
    from bns.hardware.emulators.virtual import NoDog
    from bns.hardware.khepera.driver import Khepera3
    from bns.models.khepera3.units import firmware

    count = 300 if quick else CASES
    rng, clock = np.random.default_rng(3), VirtualClock()
    robot = Khepera3(VirtualLine(Fuzz(rng), clock), clock, guard=NoDog())
    calls = (
        robot.identify, robot.speeds, robot.positions, robot.proximity, robot.ambient,
        robot.battery, robot.everything, robot.stop, lambda: robot.drive(0.1, -0.1),
    )  # fmt: skip
    crashes, hangs, answered, refused = [], 0, 0, 0
    slowest = 0.0
    for number in range(count):
        robot.units = firmware(2)
        begin = clock.now()
        try:
            calls[number % len(calls)]()
            answered += 1
        except BnsError:
            refused += 1
        except (ArithmeticError, LookupError, TypeError, ValueError, OSError) as error:
            crashes.append(repr(error))
        took = clock.now() - begin
        slowest = max(slowest, took)
        hangs += took > LONGEST
    found, tried = _frames(rng, count)
    bad = len(crashes) + hangs + found
    return Result(
        figure=bad,
        unit="crashes and hangs",
        holds=bad == 0,
        n=count + tried,
        details={
            "answered": answered,
            "refused": refused,
            "slowest call [s, virtual]": round(slowest, 3),
            "crashes": crashes[:5],
            "parsed lines and packets": tried,
        },
    )


def _frames(rng: np.random.Generator, count: int) -> tuple[int, int]:
    """The parsers alone; gives crashes and cases."""
    from bns.hardware.dynamixel import packets
    from bns.hardware.khepera import protocol

    crashes = 0
    for _ in range(count):
        size = int(rng.integers(0, 90))
        data = rng.integers(0, 256, size, dtype=np.uint8).tobytes()
        try:
            for letter in "bdenorvz":
                protocol.numbers(data, letter)
            protocol.decimal(data)
            protocol.frame(data[:67].ljust(67, b"x"))
            packets.instructions(b"\xff\xff" + data)
        except (ArithmeticError, LookupError, TypeError, ValueError):
            crashes += 1
    return crashes, count
