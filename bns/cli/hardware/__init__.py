"""`bns hardware`: rehearse with an emulated robot, set up, check, calibrate, record."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from bns.cli.fields import Positional, Seed
from bns.cli.parse import dispatch
from bns.errors import BnsError

if TYPE_CHECKING:
    from bns.worlds.light.law import Lamp

MANUAL = """usage: bns hardware {rehearse,setup,find-port,...} [...]

  rehearse   all of it on a virtual robot: emulate, check, record, diagnose
  setup      asks for port, camera and calibrations, and writes them to a file
  find-port  which serial port is the robot's
  emulate    a virtual robot on a serial port, with a camera above it
  check      battery, firmware, sensors, link, camera, tag; moves with --move
  calibrate  camera (lens, place, height of the tag), wheels, servo zeros
  record     drive safe commands and write a dataset for `bns gap`

`bns run PRESET --world hardware --setup hardware.toml` learns on the robot.
`bns hardware VERB --help` is the manual of a verb."""

Robot = Literal["khepera3", "phantomx"]


@dataclass(frozen=True, kw_only=True)
class Emulate:
    """A virtual robot on a serial port, until Ctrl-C. Signals: USR1 pulls and plugs its
    cable, USR2 covers and uncovers the camera.
    """

    robot: Positional[Robot] = "khepera3"
    """which one"""
    port: str = "bns-robot"
    """path of a link to the port; give it as --port elsewhere"""
    effects: tuple[str, ...] = ()
    """what is wrong with its body, see `bns effects`"""
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """where it stands: x, y [m], yaw [deg]"""
    firmware: int = 2
    """version that it answers"""
    latency: float = 0.01
    """of the link, one way [s]"""
    battery: float = 0.0
    """voltage [V]; 0 = full, 7.9 V or 11.1 V"""
    lost: float = 0.0
    """probability that a byte is lost"""
    corrupted: float = 0.0
    """probability that a packet is corrupted"""
    rate: float = 30.0
    """pictures of the camera a second"""
    seed: Seed = 0
    """of what is random"""
    log: str = ""
    """file for a line whenever set point or motion, or the hexapod's torque, change"""
    baud: int = 0
    """rate that it talks at; 0 = the robot's own"""
    servos: str = ""
    """hexapod: file that says how its horns really sit"""
    absent: tuple[int, ...] = ()
    """hexapod: servos that are not there"""
    doubled: tuple[int, ...] = ()
    """hexapod: numbers that two servos have"""
    upset: float = 0.0
    """hexapod: probability that a status carries a random error bit"""
    lamp: tuple[float, ...] = ()
    """Khepera: a lamp on the board: x, y, and if not as usual height [m], power [W]"""


@dataclass(frozen=True, kw_only=True)
class Rehearse:
    """All of it on a virtual robot with a fault: emulate, check, record, diagnose.
    Takes some minutes; the recording and the diagnosis stay in --out.
    """

    robot: Positional[Robot] = "khepera3"
    """which one"""
    effects: tuple[str, ...] = ()
    """what is wrong with its body, see `bns effects`; default: a weak wheel or servo"""
    sound: bool = False
    """nothing is wrong with it"""
    trials: int = 6
    """trials of the recording"""
    commands: int = 8
    """commands of a trial"""
    out: str = "rehearsal"
    """directory to write"""
    seed: Seed = 0
    """of what is random"""


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Ask how the robot is reached, say what each answer means, and write the file
    that --setup takes. Answers may come from a pipe, a line each.
    """

    out: str = "hardware.toml"
    """file to write"""
    force: bool = False
    """replace it if it is there"""


@dataclass(frozen=True, kw_only=True)
class FindPort:
    """List the serial ports, and find the robot's: pull its cable out when asked."""

    ask: bool = False
    """ask each port who it is instead; other devices get some bytes, too"""


@dataclass(frozen=True, kw_only=True)
class Connection:
    """How to reach the robot and the camera."""

    setup: str = ""
    """file that `bns hardware setup` wrote; what is given here goes before it"""
    port: str = ""
    """the robot's device, e.g. /dev/rfcomm0"""
    robot: Robot = "khepera3"
    """which one it is"""
    camera: str = "emulated"
    """number of a camera, a video file, or emulated"""
    calibration: str = ""
    """file that `bns hardware calibrate` wrote; needed for a real camera"""
    wheels: str = ""
    """Khepera: file of its wheels, see `bns hardware calibrate`; else nominal"""
    servos: str = ""
    """hexapod: file of its servos, see `bns hardware calibrate`"""


@dataclass(frozen=True, kw_only=True)
class Check(Connection):
    """Check robot, link, camera and tag. Nothing moves without --move."""

    move: bool = False
    """turn and drive a little, to see wheels, directions and tracking agree"""


@dataclass(frozen=True, kw_only=True)
class Calibrate(Connection):
    """camera: find its place from the floor tags and check the height of the robot's
    tag; with --views the lens first. wheels: drive a little, find their sizes and the
    axle. servos: read the hexapod's zeros, its legs held half-way, torque off. Nothing
    moves but for wheels, with --move.
    """

    what: Literal["camera", "wheels", "servos"] = "camera"
    """what to calibrate"""
    views: tuple[str, ...] = ()
    """pictures of the ChArUco board (8 x 6 squares of 40 mm), for the lens"""
    out: str = ""
    """file to write (default: camera.json, wheels.json, servos.toml)"""
    move: bool = False
    """wheels: say that the robot may move"""


@dataclass(frozen=True, kw_only=True)
class Record(Connection):
    """Drive safe excitation commands, each list twice, and write a dataset."""

    out: str = "recording"
    """directory to write"""
    trials: int = 8
    """trials; every second one repeats the one before"""
    commands: int = 10
    """commands of a trial"""
    plan: str = ""
    """drive these commands instead: a file that `bns gap plan` wrote"""
    damage: tuple[str, ...] = ()
    """software damage, see `bns effects`"""
    seed: Seed = 0
    """of the commands"""
    move: bool = False
    """say that the robot may move"""


def main(verb: str, argv: list[str]) -> int:
    """Run a verb of the hardware mode; gives the exit code."""
    from bns.cli.hardware import session
    from bns.cli.hardware import setup as hardware_setup

    def connected(act: Callable[[Any], int]) -> Callable[[Any], int]:
        from bns.hardware.setup import filled

        return lambda given: act(filled(given))

    does: dict[str, tuple[type, Callable[[Any], int]]] = {
        "rehearse": (Rehearse, hardware_setup.rehearse),
        "setup": (Setup, hardware_setup.setup),
        "find-port": (FindPort, hardware_setup.find_port),
        "emulate": (Emulate, _emulate),
        "check": (Check, connected(session.check)),
        "calibrate": (Calibrate, connected(session.calibrate)),
        "record": (Record, connected(session.record)),
    }
    return dispatch(verb, argv, does, MANUAL)


def _emulate(given: Emulate) -> int:
    for name in ("lost", "corrupted", "upset"):
        if not 0 <= getattr(given, name) <= 0.5:
            raise BnsError(f"--{name} = {getattr(given, name)}: give 0 to 0.5.")
    lights = _lamps(given)
    print(f"{given.robot} on {given.port}; Ctrl-C ends it.", flush=True)
    from bns.hardware.clock import urgent

    urgent()
    x, y, yaw = given.start
    shared: dict[str, Any] = {
        "effects": given.effects,
        "start": (x, y, math.radians(yaw)),
        "lost": given.lost,
        "corrupted": given.corrupted,
        "rate": given.rate,
        "seed": given.seed,
        "log": given.log,
    }
    if given.baud:
        shared["baud"] = given.baud
    if given.battery:
        shared["battery"] = given.battery
    if given.robot == "phantomx":
        from bns.hardware.dynamixel.joints import FILE
        from bns.hardware.emulators.run import phantomx

        phantomx(
            given.port,
            servos=given.servos or FILE,
            absent=given.absent,
            doubled=given.doubled,
            upset=given.upset,
            **shared,
        )
        return 0
    from bns.hardware.emulators.run import khepera3

    khepera3(
        given.port,
        version=(given.firmware, 0),
        latency=given.latency,
        lights=lights,
        **shared,
    )
    return 0


def _lamps(given: Emulate) -> "tuple[Lamp, ...]":
    """The lamp of an emulated board, if there is one.

    Raises:
        BnsError: no place, or a robot that sees no light.
    """
    if not given.lamp:
        return ()
    if given.robot != "khepera3":
        raise BnsError(f"--lamp: {given.robot} has no light sensors; leave it out.")
    if not 2 <= len(given.lamp) <= 4:
        raise BnsError(
            f"--lamp has {len(given.lamp)} numbers: give x, y, and if you like height "
            "[m] and power [W], such as --lamp 0 0."
        )
    from bns.worlds.light.law import Lamp

    names = ("x", "y", "height", "power")
    return (Lamp(**dict(zip(names, given.lamp, strict=False))),)
