"""Whether the motors stop whatever becomes of the process that drives them."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from bench._drives import DRIVES, Drive
from bench._hardware import emulator, folder
from bench.result import Result

DOC = "time to the last stop order of a moving robot after its driver dies, 7 ways"
BAR = "all stop, <= 0.5 s where the link lives"
LIMIT = 0.5  # s
NEVER = 1e3  # s, where it does not stop at all
SPARE = 10  # drives that may end before anything happened
WAYS = ("SIGINT", "SIGTERM", "SIGKILL", "SIGSTOP", "unplugged", "camera", "learner")
"""SIGSTOP: the process hangs; unplugged: the cable comes back 2 s later"""


def run(quick: bool) -> Result:
    """Drive emulated robots in real time, let something happen, read their logs.

    The time counts from the event (for the cable: from its return) to the moment at
    which the Khepera has the order to stand and the hexapod's servos are without
    torque; how long the Khepera's wheels then roll on is beside it. A drive that ended
    before anything happened to it (a machine so busy that the tracker came too late)
    says nothing of the event: it is counted, and repeated. The figure is the slowest.
    Quick: the Khepera alone, once each.
    """
    from bns.hardware.priority import urgent

    urgent()  # else the moment of the event is noted late
    details: dict[str, object] = {}
    slowest, count = 0.0, 0
    for drive in DRIVES[:1] if quick else DRIVES:
        rows, failed = _all(drive, 1 if quick else 5)
        worst = {
            w: max((r["told"] for r in rs), default=NEVER) for w, rs in rows.items()
        }
        details |= {f"{drive.robot}, {w}, slowest [s]": v for w, v in worst.items()}
        stands = [r["stands"] for rs in rows.values() for r in rs if "stands" in r]
        if stands:
            details["wheels stand after, slowest [s]"] = max(stands)
        details[f"{drive.robot}, ended before the event, repeated"] = failed
        slowest = max(slowest, *worst.values())
        count += sum(map(len, rows.values()))
    details["load of the machine (1 min)"] = round(os.getloadavg()[0], 1)
    return Result(
        figure=round(slowest, 4),
        unit="s",
        holds=slowest <= LIMIT,
        n=count,
        details=details,
    )


def _all(drive: Drive, repeats: int) -> tuple[dict[str, list], list[str]]:
    """Times of every way, and why drives ended before anything happened."""
    rows: dict[str, list] = {way: [] for way in WAYS}
    failed: list[str] = []
    with folder() as path:
        port, log = path / "robot", path / "log.jsonl"
        words = ("--log", str(log), *drive.words)
        with emulator(port, *words, robot=drive.robot) as robot:
            for way in WAYS:
                while len(rows[way]) < repeats and len(failed) < SPARE:
                    row, why = _once(drive, way, port, log, robot)
                    rows[way] += [row] if row else []
                    failed += [] if row else [f"{way}: {why}"]
    return rows, failed


def _once(
    drive: Drive, way: str, port: Path, log: Path, robot: subprocess.Popen
) -> tuple[dict[str, float] | None, str]:
    """Times of one drive, or why there are none."""
    begin, at = time.monotonic(), 0.0
    words = [sys.executable, "-c", drive.script, str(port), way]
    driver = subprocess.Popen(
        words,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        if not _wait(log, lambda rows: drive.steady(rows, begin), 90.0):
            return None, _last(driver)
        at = _happen(way, driver, robot)
        _wait(log, lambda rows: drive.ended(rows, at), 5.0)
    finally:
        driver.kill()
        driver.wait()
        if way == "camera" and at:
            robot.send_signal(signal.SIGUSR2)
    rows = _rows(log)
    if not drive.driven(rows, at):
        return None, _last(driver)
    return {
        name: round(min(times, default=at + NEVER) - at, 4)
        for name, times in drive.times(rows, at).items()
    }, ""


def _last(driver: subprocess.Popen) -> str:
    """The last line that a driver wrote before it ended."""
    driver.kill()
    lines = driver.stderr.read().strip().splitlines()
    return lines[-1][-200:] if lines else "it did not get under way"


def _happen(way: str, driver: subprocess.Popen, robot: subprocess.Popen) -> float:
    """Let it happen; gives the moment from which time counts [s]."""
    if way.startswith("SIG"):
        at = time.monotonic()
        driver.send_signal(getattr(signal, way))
        return at
    if way == "unplugged":
        robot.send_signal(signal.SIGUSR1)
        time.sleep(2.0)
        at = time.monotonic()
        robot.send_signal(signal.SIGUSR1)
        return at
    if way == "camera":
        at = time.monotonic()
        robot.send_signal(signal.SIGUSR2)
        return at
    driver.stdin.write("now\n")
    driver.stdin.flush()
    for line in driver.stdout:
        if line.startswith("now"):
            return float(line.split()[1])
    return time.monotonic()


def _rows(log: Path) -> list[dict]:
    if not log.exists():
        return []
    lines = log.read_text().splitlines()
    return [json.loads(line) for line in lines if line.endswith("}")]


def _wait(log: Path, good, seconds: float) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if good(_rows(log)):
            return True
        time.sleep(0.05)
    return False
