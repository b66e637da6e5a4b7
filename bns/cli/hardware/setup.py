"""`bns hardware setup`, `find-port` and `rehearse`."""

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bns.errors import BnsError

NONE = "none"
"""answer that leaves something out"""
START = 60.0
"""s for an emulated robot to appear"""
DAMAGE = {
    "khepera3": "wheel_gain:wheel=left,factor=0.8",
    "phantomx": "servo_gain:servo=right_front,factor=0.5",
}
"""what is wrong with the robot of a rehearsal, where nothing else was said"""


@dataclass(frozen=True)
class Question:
    """One question of `bns hardware setup`.

    Attributes:
        key: of the set-up file.
        ask: the question.
        why: what the answer means; it stands in the file as well.
        check: what is wrong with an answer, "" = nothing.
        usual: the answer where nothing is typed, from what was answered before.
        needed: whether it is asked, likewise.
    """

    key: str
    ask: str
    why: str
    check: Callable[[str], str]
    usual: Callable[[dict[str, str]], str]
    needed: Callable[[dict[str, str]], bool] = lambda found: True


def setup(given: Any) -> int:
    """`bns hardware setup`; gives the exit code.

    Raises:
        BnsError: the file exists, or the answers ended early.
    """
    from bns.hardware import setup

    out = Path(given.out)
    if out.exists() and not given.force:
        raise BnsError(f"{out} exists: add --force to replace it, or give --out.")
    print("A line for each answer; an empty one takes what stands in brackets.")
    found: dict[str, str] = {}
    said: dict[str, str] = {}
    for question in _questions():
        if question.needed(found):
            found[question.key] = _answer(question, question.usual(found))
            said[question.key] = question.why
    made = setup.Setup(**found)  # type: ignore[arg-type]
    setup.write(out, made, said)
    print(f"\n{out} is written. Next:")
    if not Path(made.port).exists():
        print(f"  there is no {made.port} now: connect the robot, or start an emulated")
    if found.get("calibration") == "" and found["camera"] != "emulated":
        print(
            f"  bns hardware calibrate --setup {out} --views PICTURES --out camera.json"
        )
        print(f'  and add this line to {out}: calibration = "camera.json"')
    print(f"  bns hardware check --setup {out}")
    print(f"  bns hardware record --setup {out} --out recording --move")
    return 0


def _answer(question: Question, usual: str) -> str:
    """What is answered, asked again until it can be."""
    print(f"\n{question.why}")
    while True:
        try:
            typed = input(f"{question.ask} [{usual or NONE}] ").strip()
        except EOFError:
            raise BnsError(
                f"The answers ended at {question.ask!r}: give one a line; nothing was "
                "written."
            ) from None
        answer = "" if typed.lower() == NONE else typed or usual
        wrong = question.check(answer)
        if not sys.stdin.isatty():  # answers from a pipe are not to be seen
            print(answer)
        if not wrong:
            return answer
        print(wrong)


def _questions() -> Iterator[Question]:
    yield Question(
        "robot",
        "Which robot?",
        "Which robot it is: khepera3 (two wheels) or phantomx (six legs).",
        lambda a: "" if a in DAMAGE else f"{a!r} is none: khepera3 or phantomx.",
        lambda found: "khepera3",
    )
    listed = _ports()
    for device, about in listed.items():
        print(f"  found {device}: {about}")
    yield Question(
        "port",
        "Its port?",
        "The device of its cable or Bluetooth, such as /dev/rfcomm0 or /dev/ttyUSB0 "
        "(`bns hardware find-port` tells which), or of an emulated one, bns-robot.",
        lambda a: "" if a else "A robot has a port: give its device.",
        lambda found: next(iter(listed), "bns-robot"),
    )
    yield Question(
        "camera",
        "Its camera?",
        "The camera above it that sees its tag: a number (0 is the first one), a video "
        "file, or emulated.",
        _no_camera,
        lambda found: "0" if found["port"].startswith("/dev/") else "emulated",
    )
    yield from _calibrated()


def _calibrated() -> Iterator[Question]:
    """What is asked about files that a calibration made."""
    yield Question(
        "calibration",
        "Its calibration?",
        "The file of the camera's lens and place, which `bns hardware calibrate` "
        "makes. Without it poses cannot be told; none = not made yet.",
        _no_file,
        lambda found: "camera.json" if Path("camera.json").is_file() else "",
        lambda found: found["camera"] != "emulated",
    )
    for robot, key, what in (
        ("khepera3", "wheels", "wheels (diameters and axle)"),
        ("phantomx", "servos", "servos (zeros and end stops)"),
    ):
        yield _measured(robot, key, what)


def _measured(robot: str, key: str, what: str) -> Question:
    """The question for the file of what was measured on one kind of robot."""
    file = {"wheels": "wheels.json", "servos": "servos.toml"}[key]
    return Question(
        key,
        f"Its {key}?",
        f"The file of its {what}, which `bns hardware calibrate --what {key}` "
        "makes; none = nominal ones.",
        _no_file,
        lambda found: file if Path(file).is_file() else "",
        lambda found: found["robot"] == robot,
    )


def _ports() -> dict[str, str]:
    from bns.hardware import line

    return line.ports()


def _no_camera(answer: str) -> str:
    if answer == "emulated" or answer.isdecimal() or Path(answer).is_file():
        return ""
    return (
        f"{answer!r} is none: give a number, a video file that is there, or emulated."
    )


def _no_file(answer: str) -> str:
    if not answer or Path(answer).is_file():
        return ""
    return f"There is no file {answer}: give another, or make it later and answer none."


def find_port(given: Any) -> int:
    """`bns hardware find-port`; gives the exit code.

    Raises:
        BnsError: there is no port, or the robot's did not go.
    """
    from bns.hardware import line

    before = line.ports()
    for device, about in before.items():
        answer = f"; answers: {line.answers(device)}" if given.ask else ""
        print(f"{device}  {about}{answer}")
    if not before:
        raise BnsError(
            "This machine has no serial port: plug the adapter in, bind Bluetooth "
            "(rfcomm bind), or emulate a robot (`bns hardware emulate`)."
        )
    if given.ask or len(before) == 1:
        return 0
    try:
        input("Which is the robot's? Pull its cable out, then press Enter. ")
    except EOFError:
        print("\n--ask asks each of them who it is.")
        return 0
    left = line.ports()
    gone = [device for device in before if device not in left]
    if len(gone) != 1:
        raise BnsError(
            f"{len(gone)} ports have gone, not one: pull out the robot's alone, or "
            "give --ask."
        )
    print(f"{gone[0]} is the robot's. Put the cable in again.")
    return 0


def rehearse(given: Any) -> int:
    """`bns hardware rehearse`; gives the exit code.

    Raises:
        BnsError: the directory exists, or a step failed.
    """
    from bns.cli.gap import diagnose as gap_diagnose
    from bns.cli.hardware import Check, Record
    from bns.cli.hardware import session as hardware_session

    out = Path(given.out)
    if out.exists():
        raise BnsError(f"{out} exists and is not overwritten; give another --out.")
    effects = given.effects or (() if given.sound else (DAMAGE[given.robot],))
    what = ", ".join(effects) or "nothing"
    print(f"1 of 4: emulate {given.robot}; wrong with it: {what}", flush=True)
    with emulated(given.robot, effects, given.seed) as port:
        reached = {"port": port, "robot": given.robot}
        print("\n2 of 4: check", flush=True)
        hardware_session.check(Check(**reached, move=given.robot == "khepera3"))
        print("\n3 of 4: record", flush=True)
        out.mkdir(parents=True)
        data = str(out / "recording")
        asked = Record(
            **reached,
            out=data,
            trials=given.trials,
            commands=given.commands,
            seed=given.seed,
            move=True,
        )
        hardware_session.record(asked)
    print("\n4 of 4: diagnose", flush=True)
    words = [data, "--model", given.robot, "--out", str(out / "diagnosis")]
    code = gap_diagnose.main("diagnose", words)
    print(f"\nWrong with it was: {what}. A real robot: `bns hardware setup`.")
    return code


@contextmanager
def emulated(robot: str, effects: tuple[str, ...], seed: int) -> Iterator[str]:
    """An emulated robot in a process of its own; gives its port.

    Args:
        robot: which one.
        effects: what is wrong with its body.
        seed: of what is random.

    Raises:
        BnsError: it did not start.
    """
    with tempfile.TemporaryDirectory(prefix="bns-") as place:
        port = Path(place) / "robot"
        words = [sys.executable, "-m", "bns", "hardware", "emulate", robot]
        words += ["--port", str(port), "--seed", str(seed)]
        words += ["--effects", *effects] if effects else []
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
        try:
            until = time.monotonic() + START
            while not port.exists():
                if process.poll() is not None or time.monotonic() > until:
                    raise BnsError("The emulated robot did not start.")
                time.sleep(0.1)
            yield str(port)
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
