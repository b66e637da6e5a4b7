"""A robot's set-up in a file: how it is reached, and what was calibrated.

    robot = "khepera3"
    port = "/dev/rfcomm0"
    camera = "0"
    calibration = "camera.json"

`bns hardware setup` writes it; the verbs of `bns hardware`, and `bns run --world
hardware`, take it as `--setup FILE`. What they are told beside it goes before.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import msgspec
import tomli_w

from bns.errors import BnsError
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
