"""Whether a moving robot is stopped in time, whatever fails."""

import contextlib
import os
import random
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from statistics import median

import numpy as np

from bench.hardware.drives import (
    CLOCK,
    DRIVES,
    QUICK,
    SPEEDS,
    WAYS,
    WHEELED,
    Drive,
    Driver,
    Log,
    Scene,
)
from bench.hardware.runs import emulator, folder, resumed
from bench.result import Result, bench
from bns.hardware.emulators.device import LiveBody
from bns.hardware.emulators.hexapod import HexapodBody
from bns.hardware.emulators.khepera import KheperaBody
from bns.hardware.emulators.run import SLOW

LIMIT, STAND = 0.2, 0.35  # s
NOTICED = 0.03  # s by which a robot's log may be late to note that it stands
NEVER = 1e3  # s, where it does not stop at all
REPEATS = 10
SPARE = 3  # drives of a way that may end before anything happened
WATCHED = 3.0  # s for which a robot is watched after the event


@bench(
    "time to the stop order and to standstill of a moving robot, 21 ways to fail",
    bar="order <= 0.2 s; standstill <= 0.35 s or what the robot's own ramp costs",
)
def hardware_stop(quick: bool) -> Result:
    """Drive emulated robots in real time, let something happen, read their logs.

    The time counts from the event (for the cable, a reset and the power: from when the
    robot hears again) to the moment at which the robot has a stop order, and to that at
    which its wheels or its trunk stand. What of the latter the robot's body needs by
    itself, told to stop in the state that it was in, and how late the machine woke a
    thread of the same priority in between, are beside it. A standstill holds within
    0.35 s, or if nothing but the body's own time and that delay follow the order. A
    drive that ended before anything happened to it says nothing of the event: it is
    counted, and repeated. The figure is the slowest order. Rows that are measured are
    kept, so that an interrupted run goes on.
    Quick: the Khepera alone, five ways, once each.
    """
    from bns.hardware.clock import urgent

    urgent()  # else the moment of the event is noted late
    details: dict[str, object] = {}
    keep = resumed("hardware-stop") if not quick else lambda label, measure: measure()
    rows: list[dict] = []
    for drive in DRIVES[:1] if quick else DRIVES:
        made = _all(drive, 1 if quick else REPEATS, QUICK if quick else WAYS, keep)
        rows += made
        details |= _described(drive.robot, made)
    slow = max(row["order"] for row in rows)
    late = [row for row in rows if row["stands"] > STAND]
    beyond = [row["ramp"] - row["own"] for row in late]
    over = [more - row["late"] for more, row in zip(beyond, late, strict=True)]
    details["stands more than 0.35 s after the event"] = len(late)
    for name, values in (("", beyond), (", the machine's delay taken off", over)):
        name = f"of them, longest beyond the body's own time{name} [s]"
        details[name] = round(max(values, default=0.0), 4)
    details["load of the machine (1 min)"] = round(os.getloadavg()[0], 1)
    return Result(
        figure=round(slow, 4),
        unit="s",
        holds=slow <= LIMIT and max(over, default=0.0) <= NOTICED,
        n=len(rows),
        details=details,
    )


def _described(robot: str, rows: list[dict]) -> dict[str, object]:
    """Times by way, the slowest first."""
    ways: dict[str, list[dict]] = {}
    for row in rows:
        ways.setdefault(row["way"], []).append(row)
    table = []
    for way, found in ways.items():
        orders, stands = ([row[k] for row in found] for k in ("order", "stands"))
        worst = max(found, key=lambda row: row["order"])
        last = max(found, key=lambda row: row["stands"])
        text = (
            f"order {median(orders):.3f}, slowest {max(orders):.3f} (machine late "
            f"{worst['late']:.3f}); stands {median(stands):.3f}, {max(stands):.3f} "
            f"(order {last['order']:.3f}, robot's own {last['own']:.3f})"
        )
        table.append((max(orders), f"{robot}, {way}, {len(found)} [s]", text))
    for _, name, text in sorted(table, reverse=True):
        print(f"{name}: {text}", flush=True)
    ended = sum(row["ended"] for row in rows)
    made = {name: text for _, name, text in sorted(table, reverse=True)}
    return made | {f"{robot}, ended before the event, repeated": ended}


def _all(drive: Drive, repeats: int, ways, keep) -> list[dict]:
    """A row for each way and repeat."""
    with folder() as path:
        port, log = path / "robot", Log(path / "log.jsonl")
        (path / "sitecustomize.py").write_text(CLOCK)
        (path / "clock").write_text("0")
        with emulator(port, "--log", str(log.path), robot=drive.robot):
            return [
                keep(
                    f"{drive.robot}-{way}-{count}".replace(" ", "-"),
                    lambda way=way, count=count: _row(drive, way, count, port, log),
                )
                for count in range(repeats)
                for way in ways
                if drive.robot == "khepera3" or way not in WHEELED
            ]


def _row(drive: Drive, way: str, count: int, port: Path, log: Log) -> dict:
    """Times of one event."""
    ended = 0
    while True:
        times = _once(drive, way, count, port, log)
        if times or ended == SPARE:
            break
        ended += 1
    never = dict.fromkeys(("order", "stands", "ramp"), NEVER)
    never |= {"own": 0.0, "late": 0.0}
    row = {"robot": drive.robot, "way": way, "ended": ended} | (times or never)
    print(row, flush=True)
    return row


def _once(
    drive: Drive, way: str, count: int, port: Path, log: Log
) -> dict[str, float] | None:
    """Times of one drive, None if it ended before anything happened."""
    clock = port.with_name("clock")
    env = {"PYTHONPATH": str(port.parent), "BENCH_CLOCK": str(clock)}
    driver = Driver(drive.robot, port, {**os.environ, **env})
    scene, at = Scene(driver, port, log, clock), 0.0
    try:
        if not _wait(lambda: drive.steady(log, driver), 60.0, driver):
            print(f"{way}: {[text for _, text in driver.said[-1:]]}", flush=True)
            return None
        # at any phase of its motion, and of the loops around it
        time.sleep(random.Random(f"{way} {count}").uniform(0.0, drive.cycle))
        before = time.monotonic()
        if not drive.driven(log, before):
            return None
        with _canary() as late:
            at = WAYS[way](scene)
            _wait(lambda: _over(drive, log, at), WATCHED)
        return _times(drive, log, at) | {"late": late[0]}
    finally:
        _clear(scene, way if at else "")


def _over(drive: Drive, log: Log, at: float) -> bool:
    order = log.first("stop", at)
    if order is None or time.monotonic() < order + SINKS + LASTS:
        return False
    return _stood(drive, log, order) is not None


def _times(drive: Drive, log: Log, at: float) -> dict[str, float]:
    order = log.first("stop", at)
    if order is None:
        return dict.fromkeys(("order", "stands", "ramp"), NEVER) | {"own": 0.0}
    stood = _stood(drive, log, order)
    stands = NEVER if stood is None else max(stood - at, 0.0)
    ramp = NEVER if stood is None else max(stood - order, 0.0)
    made = {"order": order - at, "stands": stands, "ramp": ramp}
    made["own"] = _own(drive, log, order)
    return {name: round(value, 4) for name, value in made.items()}


def _own(drive: Drive, log: Log, order: float) -> float:
    """Time that the body needs after an order [s]; it may have lost its torque before.

    The set point of wheels outlives a reset, not the loss of power.
    """
    if drive.robot == "khepera3":
        return khepera3_ramp()
    falls = log.newest("state", 0.0, order + ROUND)
    if not falls:
        return 0.0
    return max(falls["at"] + phantomx_ramp(falls["state"]) - order, 0.0)


def _stood(drive: Drive, log: Log, order: float) -> float | None:
    """When the robot has come to rest after an order [s]; None: not yet."""
    rows = [(row["at"], row["stands"]) for row in log.rows() if "stands" in row]
    return came_to_rest(rows, order, sinks=drive.robot == "phantomx")


@contextlib.contextmanager
def _canary() -> Iterator[list[float]]:
    """By how much the machine wakes a thread too late at most [s]."""
    from bns.hardware.clock import urgent

    worst, over = [0.0], threading.Event()

    def sleep() -> None:
        urgent()
        while not over.is_set():
            begin = time.monotonic()
            time.sleep(0.005)
            late = time.monotonic() - begin - 0.005
            worst[0] = round(max(worst[0], late), 4)

    thread = threading.Thread(target=sleep, daemon=True)
    thread.start()
    try:
        yield worst
    finally:
        over.set()
        thread.join()


def _clear(scene: Scene, way: str) -> None:
    """End the driver, its watchdog and what goes on."""
    process, dog = scene.driver.process, scene.driver.watchdog
    process.kill()
    process.wait()
    scene.clock.write_text("0")
    ends = {"camera covered": "covered", "picture frozen": "frozen"}
    ends |= {"picture stuck, noise fresh": "stuck", "time stamps stale": "stale"}
    word = "flood" if way.startswith("flood") else ends.get(way, "")
    if word and scene.log.rows():
        scene.mishap(word)
    if "watchdog" in way and dog:
        with contextlib.suppress(ProcessLookupError):
            os.kill(dog, signal.SIGKILL)
    _wait(lambda: not dog or _gone(dog), 5.0)


def _gone(pid: int) -> bool:
    """Whether a process has ended."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return True
    return state in "ZX"


def _wait(good, seconds: float, driver: Driver | None = None) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if good():
            return True
        if driver is not None and driver.process.poll() is not None:
            return False
        time.sleep(0.02)
    return False


ROUND = 0.0045  # s between two looks, as in the emulator's log
SINKS, LASTS = 0.3, 0.1  # s until a hexapod sinks, s that rest lasts
BLUR = 0.02  # s by which a log may take a moment's rest for longer than it was
STEADY, ENDS = 2.0, 2.0  # s of driving before; s after which it stands


@cache
def khepera3_ramp() -> float:
    """Time in which wheels told to stand do so, from the speeds of the bench [s]."""
    body = KheperaBody()
    body.tell(0.0, *SPEEDS)
    body.advance(STEADY)
    body.tell(STEADY, 0.0, 0.0)
    return _time(body, lambda: max(map(abs, body.wheel_speeds())) < SLOW)


def phantomx_ramp(state: Sequence[float]) -> float:
    """Time in which a hexapod without torque comes to rest [s].

    Args:
        state: of the physics, when the torque goes.
    """
    body = HexapodBody()
    for on in (True, False):
        for number in body.joints:
            body.power(number, on)
    body.state = np.array(state)
    return _time(body, body.rests, sinks=True)


def came_to_rest(
    rows: Sequence[tuple[float, bool]],
    begin: float,
    *,
    sinks: bool,
    lasts: float = LASTS,
) -> float | None:
    """When a robot has come to rest after it was told to [s]; None: not yet.

    Args:
        rows: when it began to stand or to move [s], and whether it stands.
        begin: when it was told to stand [s].
        sinks: it stands on its legs when it is told, and sinks a moment later.
        lasts: how long rest has to last to be rest [s].
    """
    state = next((stands for at, stands in reversed(rows) if at <= begin), True)
    later = [row for row in rows if row[0] > begin]
    sinks = sinks and any(at < begin + SINKS for at, stands in later if not stands)
    if state and not sinks:
        return begin
    for (at, stands), (end, _) in pairwise([*later, (np.inf, False)]):
        if stands and end - at > lasts:
            return at
    return None


def _time(body: LiveBody, stands: Callable[[], bool], *, sinks: bool = False) -> float:
    """From now to rest [s]."""
    begin = body.now
    rows = [(begin, stands())]
    for at in np.arange(begin + ROUND, begin + ENDS, ROUND):
        body.advance(at)
        if stands() != rows[-1][1]:
            rows.append((float(at), stands()))
    found = came_to_rest(rows, begin, sinks=sinks, lasts=LASTS + BLUR)
    return np.inf if found is None else found - begin
