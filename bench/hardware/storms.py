"""Bad lines: bytes that nobody sent, and every fault at once."""

from collections import Counter

import numpy as np

from bench.hardware.runs import resumed
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
    from bns.hardware.emulators.run import NoDog
    from bns.hardware.khepera.driver import Khepera3
    from bns.models.khepera3 import firmware

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
        robot._firmware = firmware(2)
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


PARTS, MINUTES = 6, 10.0  # each part is a session of its own, with its own seed
LOST, CORRUPTED, MUTE = 0.01, 0.01, 0.005
FAR, TURNED = 0.005, np.deg2rad(3.0)  # m, rad: what a command's end may be off
ASTRAY = 0.03  # m that a wheel may be led astray within a command: 0.25 s at 0.12 m/s


@bench(
    "trials over a line with 1 % lost bytes, 1 % corrupted packets, mute answers",
    bar="no wrong trial accepted, no hang, every fault logged (60 min of trials)",
)
def hardware_fault_storm(quick: bool) -> Result:
    """Sessions in virtual time: emulated robot, line, camera and tracker.

    A trial that is accepted is wrong if a pose at a command's end is off the true one
    at its moment, or if the set points that reached the robot led a wheel astray of
    the commands recorded. The figure is the number of wrong trials. Parts that are
    done are kept, so that an interrupted run goes on with the next one.
    """
    if quick:
        parts = [_part(0, 1.0)]
    else:
        keep = resumed("hardware-fault-storm")
        parts = [keep(f"part-{k}", lambda k=k: _part(k, MINUTES)) for k in range(PARTS)]
    wrong = [text for part in parts for text in part["wrong"]]
    kinds: Counter[str] = Counter()
    for part in parts:
        kinds.update(part["faults"])
    minutes = sum(part["minutes"] for part in parts)
    logged = all(part["logged"] for part in parts)
    return Result(
        figure=len(wrong),
        unit="wrong trials",
        holds=not wrong and logged and (quick or minutes >= PARTS * MINUTES),
        n=sum(part["trials"] for part in parts),
        details={
            "virtual minutes": round(minutes, 2),
            "void trials, repeated": sum(part["voids"] for part in parts),
            "bytes lost": sum(part["lost"] for part in parts),
            "packets corrupted": sum(part["corrupted"] for part in parts),
            "faults logged": dict(kinds),
            "latest command [s]": max(part["late"] for part in parts),
            "wrong": wrong,
        },
    )


def _part(number: int, minutes: float) -> dict:
    """A session of some virtual minutes."""
    from bns.hardware.driving.excitation import commands
    from bns.hardware.emulators import run
    from bns.hardware.worlds.wheeled import HardwareWorld

    rig = run.rig(lost=LOST, corrupted=CORRUPTED, mute=MUTE, seed=11 + number)
    world = HardwareWorld(rig=rig)
    wrong, trials, late = [], 0, 0.0
    while rig.clock.now() < 60 * minutes:
        told = commands(8, seed=5 + number, number=trials)
        (trial,) = world.run([told], trial=trials)
        fault = _wrong(rig, trial)
        if fault:
            wrong.append(f"part {number}, trial {trials}: {fault}")
        late = max(late, trial.conditions["late"])
        trials += 1
    return {
        "wrong": wrong,
        "trials": trials,
        "voids": world.voids,
        "minutes": rig.clock.now() / 60,
        "late": late,
        "faults": dict(rig.faults.counts),
        "logged": len(rig.faults.faults) == len(rig.faults) > 0,
        **rig.line.device.counts,
    }


def _wrong(rig, trial) -> str:
    """What is wrong with an accepted trial; empty if nothing is."""
    begin = trial.conditions["began"]
    log = [row for row in rig.device.log if row[0] >= begin]
    first = trial.conditions["first"]
    seen = trial.command_poses_world
    for index, at in enumerate(trial.times[trial.boundaries]):
        true = rig.body.pose(first + at)
        off = seen[index] - true
        off[2] = (off[2] + np.pi) % (2 * np.pi) - np.pi
        if not np.isfinite(off).all():
            continue
        if np.hypot(*off[:2]) > FAR or abs(off[2]) > TURNED:
            return f"pose {index} is off by {np.round(off, 4).tolist()}"
    return _astray(rig, trial, log, first)


def _astray(rig, trial, log, first: float) -> str:
    """Compare the set points that held with the commands recorded."""
    dt = 0.005
    times = np.arange(0, trial.commands.duration, dt)
    ends = np.cumsum(trial.commands.durations)
    index = np.minimum(np.searchsorted(ends, times, side="right"), len(ends) - 1)
    moments = np.array([row[0] for row in log]) - first
    held = np.array([row[1:] for row in log], float)
    at = np.clip(np.searchsorted(moments, times, side="right") - 1, 0, None)
    units = rig.robot.units.speed_units
    off = np.abs(held[at].clip(-48000, 48000) / units - trial.commands.values[index])
    for command in range(len(ends)):
        way = off[index == command].sum(0) * dt
        if way.max(initial=0.0) > ASTRAY:
            return f"command {command} led a wheel {way.max():.4f} m astray"
    return ""
