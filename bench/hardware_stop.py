"""Whether the motors stop whatever becomes of the process that drives them."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from bench._hardware import emulator, folder
from bench.result import Result

DOC = "time to the last stop order of a moving robot after its driver dies, 7 ways"
BAR = "all stop, <= 0.5 s where the link lives"
LIMIT = 0.5  # s
NEVER = 1e3  # s, where it does not stop at all
DRIVE = """
import sys
from bns.hardware.priority import urgent
urgent()
from bns.hardware.world import HardwareWorld
from bns.worlds import alarm
from bns.worlds.trial import Commands
world = HardwareWorld(port=sys.argv[1], start=(-0.9, 0.0, 0.0))
world.connected()
if sys.argv[2] == "learner":
    import threading, time
    def fail():
        sys.stdin.readline()
        print("now", time.monotonic(), flush=True)
        alarm.ring("the learner failed")
    threading.Thread(target=fail, daemon=True).start()
print("ready", flush=True)
world.run([Commands([[0.06, 0.07]], [25.0])])
"""
DRIVEN = [8641, 10081]  # speed units of 0.06 and 0.07 m/s, firmware 2
WAYS = ("SIGINT", "SIGTERM", "SIGKILL", "SIGSTOP", "unplugged", "camera", "learner")
"""SIGSTOP: the process hangs; unplugged: the cable comes back 2 s later"""


def run(quick: bool) -> Result:
    """Drive an emulated robot in real time, let something happen, read its log.

    The time counts from the event (for the cable: from its return) to the moment at
    which the robot has the order to stand; how long its wheels then roll on is beside
    it. The figure is the slowest.
    """
    from bns.hardware.priority import urgent

    urgent()  # else the moment of the event is noted late
    repeats = 1 if quick else 5
    with folder() as path:
        port, log = path / "robot", path / "log.jsonl"
        with emulator(port, "--log", str(log), "--start", "-0.9", "0", "0") as robot:
            rows: dict[str, list] = {way: [] for way in WAYS}
            failed: list[str] = []
            for way in WAYS:
                while len(rows[way]) < repeats and len(failed) < 10:
                    row, why = _once(way, port, log, robot)
                    rows[way] += [row] if row else []
                    failed += [] if row else [f"{way}: {why}"]
    worst = {
        way: max((row["told"] for row in tried), default=NEVER)
        for way, tried in rows.items()
    }
    details: dict[str, object] = {f"{w}, slowest [s]": v for w, v in worst.items()}
    details["wheels stand after, slowest [s]"] = max(
        (row["stands"] for tried in rows.values() for row in tried), default=NEVER
    )
    details["drives that ended before the event, repeated"] = failed
    details["load of the machine (1 min)"] = round(os.getloadavg()[0], 1)
    slowest = max(worst.values())
    return Result(
        figure=round(slowest, 4),
        unit="s",
        holds=slowest <= LIMIT,
        n=repeats * len(WAYS),
        details=details,
    )


def _once(
    way: str, port: Path, log: Path, robot: subprocess.Popen
) -> tuple[dict[str, float] | None, str]:
    """Times of one drive, or why there are none."""
    begin, at = time.monotonic(), 0.0
    words = [sys.executable, "-c", DRIVE, str(port), way]
    driver = subprocess.Popen(
        words,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        if not _wait(log, lambda rows: _steady(rows, begin), 60.0):
            return None, _last(driver)
        at = _happen(way, driver, robot)
        _wait(log, lambda rows: _stood(rows, at), 5.0)
    finally:
        driver.kill()
        driver.wait()
        if way == "camera" and at:
            robot.send_signal(signal.SIGUSR2)
    rows = _rows(log)
    if not _driven(rows, at):
        return None, _last(driver)
    told = [r["at"] for r in rows if r.get("told") == [0, 0] and r["at"] >= at]
    stands = [r["at"] for r in rows if r.get("stands") and r["at"] >= at]
    row = {
        "told": round(min(told, default=at + NEVER) - at, 4),
        "stands": round(min(stands, default=at + NEVER) - at, 4),
    }
    return row, ""


def _driven(rows: list[dict], at: float) -> bool:
    """Whether the newest order before a moment was to drive."""
    told = [row["told"] for row in rows if "told" in row and row["at"] < at]
    return bool(told) and told[-1] == DRIVEN


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


def _steady(rows: list[dict], begin: float) -> bool:
    """Whether the long drive of the trial has gone on for a moment."""
    told = [row for row in rows if "told" in row and row["at"] > begin]
    return bool(
        told and told[-1]["told"] == DRIVEN and time.monotonic() - told[-1]["at"] > 0.7
    )


def _stood(rows: list[dict], since: float) -> bool:
    return any(row.get("stands") and row["at"] >= since for row in rows)


def _wait(log: Path, good, seconds: float) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if good(_rows(log)):
            return True
        time.sleep(0.05)
    return False
