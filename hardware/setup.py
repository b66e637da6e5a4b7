"""A robot's set-up in a file, and calibrating a camera with what lies on the board.

    robot = "khepera3"
    port = "/dev/rfcomm0"
    camera = "0"
    calibration = "camera.json"

`bns hardware setup` writes it; the verbs of `bns hardware`, and `bns run --world
hardware`, take it as `--setup FILE`. What they are told beside it goes before.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import msgspec
import tomli_w

from bns.errors import BnsError
from bns.hardware import rig as rigs
from bns.hardware.clock import RealClock
from bns.hardware.tracking import calibrate
from bns.hardware.tracking.camera import Camera, cv2
from bns.hardware.tracking.eyes import DeviceCamera, Source, ThreadedEyes, VideoFile
from bns.hardware.tracking.marker import MARKERS, Floor
from bns.hardware.tracking.tracker import Tracker
from bns.storage import files, reading

FILE = "hardware.toml"
FILES = ("calibration", "wheels", "servos")
"""keys that name files, which lie beside the set-up"""


class Setup(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """How a robot and its camera are reached.

    Attributes:
        robot: which one it is.
        port: its device, such as /dev/rfcomm0, or the link of an emulated one.
        camera: number of the camera above it, a video file, or "emulated".
        calibration: file of the camera, which `bns hardware calibrate` wrote; a real
            camera needs it.
        wheels: file of a Khepera's wheels, likewise; "" = nominal ones.
        servos: file of a hexapod's servos, likewise; "" = nominal ones.
    """

    robot: Literal["khepera3", "phantomx"] = "khepera3"
    port: str = ""
    camera: str = "emulated"
    calibration: str = ""
    wheels: str = ""
    servos: str = ""


def read(path: Path | str) -> Setup:
    """The set-up in a file; the files that it names are found from there.

    Raises:
        FormatError: no such file, not TOML, or an unknown key.
        BnsError: a file that it names is not there.
    """
    path = Path(path)
    todo = "Make it with `bns hardware setup`."
    found = reading.typed(reading.read_toml(path), Setup, path, todo=todo)
    places = {}
    for key in FILES:
        name = getattr(found, key)
        if name:
            places[key] = str(path.parent / name)
            if not Path(places[key]).is_file():
                raise BnsError(
                    f"{path}: {key} = {name!r}, and there is no file {places[key]}; "
                    "`bns hardware calibrate` makes it."
                )
    return msgspec.structs.replace(found, **places)


def write(path: Path | str, setup: Setup, said: dict[str, str]) -> None:
    """Write a set-up; what is as it would be without the file is left out.

    Args:
        path: of the file, replaced whole.
        setup: what to write.
        said: by key, a line on what it means, which stands above it.

    Raises:
        StorageError: it cannot be written.
    """
    plain = Setup()
    lines = ["# How the robot is reached; made by `bns hardware setup`."]
    for key, value in msgspec.structs.asdict(setup).items():
        if key in ("robot", "port") or value != getattr(plain, key):
            lines += [f"# {said[key]}"] if key in said else []
            lines += [tomli_w.dumps({key: value}).rstrip()]
    files.write_text(Path(path), "\n".join(lines) + "\n")


def filled(given: Any, robot: str = "") -> Any:
    """Arguments of the command line, what was not given taken from `--setup`.

    Args:
        given: a dataclass with the attributes of `Setup` and `setup`, the file.
        robot: that it has to be of; "" = any.

    Raises:
        FormatError: as `read`.
        BnsError: as `read`; the file is of another robot.
    """
    if not given.setup:
        return given
    found, plain = read(given.setup), Setup()
    if robot and found.robot != robot:
        raise BnsError(
            f"{given.setup} is of {found.robot}, this needs {robot}: give another file."
        )
    changed = {
        key: value
        for key, value in msgspec.structs.asdict(found).items()
        if hasattr(given, key) and getattr(given, key) == getattr(plain, key)
    }
    return replace(given, **changed)


PICTURES = 40  # in which the tag's size is measured
ASKEW = 8.0  # deg that the tag's edges have to be off the rows of the picture
TIME = 20.0  # s for them


def lens(paths: Sequence[str]) -> calibrate.Lens:
    """The lens from picture files of the board of squares.

    Raises:
        BnsError: a file is no picture, or too few show the board.
    """
    views = []
    for path in paths:
        view = cv2().imread(path, cv2().IMREAD_GRAYSCALE)
        if view is None:
            raise BnsError(f"{path} is no picture that OpenCV can read.")
        views.append(view)
    return calibrate.lens(views, calibrate.squares())


def camera(
    port: str,
    name: str,
    known: str,
    found: calibrate.Lens | None,
    out: Path,
    *,
    robot: str = "khepera3",
) -> Iterator[str]:
    """Find the camera's place, write it, and say what was found, line by line.

    Args:
        port: of the emulated robot, where the camera is emulated.
        name: number of a camera, a video file, or "emulated".
        known: file of an earlier calibration, whose lens is taken.
        found: the lens, where it was calibrated now.
        out: file to write.
        robot: whose tag is looked for.

    Raises:
        BnsError: no lens, no camera, no floor tags.
    """
    marker = MARKERS[robot]
    source, base = _source(port, name, known, found, robot)
    frame = None
    clock = RealClock()
    until = clock.now() + TIME
    while frame is None and clock.now() < until:
        frame = source.read(1.0)
    if frame is None:
        raise BnsError("The camera gives no picture: check it.")
    placed = calibrate.place(frame.image, base, Floor())
    if found is not None:
        yield f"lens    {found.error:.2f} px left over"
    x, y, z = placed.position
    yield f"place   {x:.3f}, {y:.3f}, {z:.3f} m"
    placed.write(out)
    eyes = ThreadedEyes(source, Tracker(placed, marker))
    try:
        seen: list = []
        while len(seen) < PICTURES and clock.now() < until:
            seen += eyes.poll()
            clock.sleep(0.05)
    finally:
        eyes.close()
    if len(seen) < 5:
        yield "tag     not in view: its height was not checked"
        return
    if calibrate.askew(seen[-1], placed) < ASKEW:
        yield (
            "tag     its edges lie along the picture's rows, which blurs its size: "
            "turn the robot by 20 to 70 deg to have its height checked"
        )
        return
    height = calibrate.height(seen, placed, marker, image=frame.image, floor=Floor())
    said = (
        f"{height.height * 1e3:.1f} mm high by its size, {height.said * 1e3:.1f} said"
    )
    yield f"tag     {said}" + ("" if height.agrees else ": WRONG, measure it again")


def _source(
    port: str, name: str, known: str, found: calibrate.Lens | None, robot: str
) -> tuple[Source, Camera | calibrate.Lens]:
    if name == rigs.EMULATED:
        from bns.hardware.emulators.camera import EmulatedCamera, painter

        ideal = replace(Camera.overhead(rigs.SIZE))
        return EmulatedCamera(port, painter(robot, ideal)), ideal
    base = found or (Camera.read(known) if known else None)
    if base is None:
        raise BnsError(
            "The camera's lens is not known: give --views with pictures of the ChArUco "
            "board, or an earlier --calibration."
        )
    if name.isdecimal():
        return DeviceCamera(int(name), base.size), base
    return VideoFile(name), base
